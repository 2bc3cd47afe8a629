"""Claims about replaying the authors' data format."""

from pathlib import Path

import numpy as np
import pytest

from emd_cloth_sim.mesh import flat_positions
from emd_cloth_sim.replay import replay_file, resample_sheet, vertex_order
from emd_core.errors import InvalidInputError

SIDE = 11


def recording(rng: np.random.Generator | None = None, side: int = SIDE) -> dict[str, np.ndarray]:
    """One sequence of two steps from a flat cloth, shuffled if a generator is given."""
    flat = flat_positions((side, side), (1.4, 1.4)) + np.array([0.0, 0.0, 0.05])
    if rng is not None:
        flat = rng.permutation(flat)
    states = np.repeat(flat[None, None], 3, axis=1).astype(np.float32)
    picks = np.full((1, 2, 2, 2), np.nan, np.float32)
    picks[0, 0] = [[-0.7, -0.7], [-0.7, 0.7]]
    moves = np.array([[[0.7, 0.0], [0.3, 0.3]]], np.float32)
    return {"states": states, "picks": picks, "moves": moves}


def test_replay_keeps_shapes_and_vertex_order(tmp_path: Path) -> None:
    """The output has the input's keys, shapes and vertex order; unused steps change nothing."""
    content = recording(np.random.default_rng(1))
    np.savez(tmp_path / "in.npz", **content)
    calls = []
    report = replay_file(
        tmp_path / "in.npz", tmp_path / "out.npz", lambda *progress: calls.append(progress)
    )
    assert report.manipulations == 2 and report.suspicious == () and report.missed == ()
    assert calls == [(1, 2), (2, 2)]
    with np.load(tmp_path / "out.npz") as result:
        assert set(result) == set(content)
        for key, value in content.items():
            assert result[key].shape == value.shape and result[key].dtype == np.float32
        states = result["states"].astype(np.float64)
    assert np.isfinite(states).all()
    np.testing.assert_array_equal(states[0, 0], content["states"][0, 0])
    np.testing.assert_array_equal(states[0, 1], states[0, 2])
    far = content["states"][0, 0, :, 0] < -0.69
    assert np.abs(states[0, 1, far, 0]).max() < 0.15, "the far side was carried to the middle"
    order = vertex_order(states[:, 0], SIDE)
    grid = states[0, 1][order].reshape(SIDE, SIDE, 3)
    assert np.linalg.norm(np.diff(grid, axis=0), axis=2).max() < 1.05 * 0.14


def test_row_major_order_needs_no_flat_start() -> None:
    """A crumpled first state in row-major order is taken as it is, a shuffled one is rejected."""
    rng = np.random.default_rng(2)
    state = recording()["states"][0, :1].astype(np.float64)
    state[..., 2] += 0.05 * np.sin(4 * state[..., 0])
    np.testing.assert_array_equal(vertex_order(state, SIDE), np.arange(SIDE**2))
    with pytest.raises(InvalidInputError):
        vertex_order(rng.permutation(state[0])[None], SIDE)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda content: content.pop("moves"),
        lambda content: content.update(states=content["states"][:, :, :-1]),
        lambda content: content.update(states=content["states"][:, :2]),
        lambda content: content.update(picks=content["picks"][..., :1]),
        lambda content: content["states"].__setitem__((0, 0, 3, 2), np.nan),
        lambda content: content["moves"].__setitem__((0, 0, 0), np.inf),
        lambda content: content["picks"].__setitem__((0, 0, 0, 0), np.nan),
    ],
)
def test_malformed_files_are_rejected(tmp_path: Path, spoil) -> None:  # noqa: ANN001
    """Missing keys, wrong shapes and values that are not finite raise; nothing is written."""
    content = recording()
    spoil(content)
    np.savez(tmp_path / "in.npz", **content)
    with pytest.raises(InvalidInputError):
        replay_file(tmp_path / "in.npz", tmp_path / "out.npz")
    assert not (tmp_path / "out.npz").exists()


def test_text_is_no_recording(tmp_path: Path) -> None:
    """A file that is no .npz raises InvalidInputError."""
    (tmp_path / "in.npz").write_text("states")
    with pytest.raises(InvalidInputError):
        replay_file(tmp_path / "in.npz", tmp_path / "out.npz")


def test_fine_mesh_is_simulated_on_a_coarser_one(tmp_path: Path) -> None:
    """A mesh above the limit keeps its shape in the file and gives about the same fold."""
    np.savez(tmp_path / "in.npz", **recording(side=21))
    replay_file(tmp_path / "in.npz", tmp_path / "full.npz")
    replay_file(tmp_path / "in.npz", tmp_path / "coarse.npz", simulated_side=11)
    with np.load(tmp_path / "full.npz") as full, np.load(tmp_path / "coarse.npz") as coarse:
        assert full["states"].shape == coarse["states"].shape
        difference = np.linalg.norm(full["states"] - coarse["states"], axis=-1)[0, 1].mean()
        moved = np.linalg.norm(full["states"][0, 1] - full["states"][0, 0], axis=-1).mean()
    assert 0 < difference < 0.5 * moved


def test_pick_beside_the_cloth_is_reported(tmp_path: Path) -> None:
    """A step whose hands miss our cloth leaves the state as it was and is listed as missed."""
    content = recording()
    content["picks"][0, 0] = [[0.9, 0.9], [np.nan, np.nan]]
    np.savez(tmp_path / "in.npz", **content)
    report = replay_file(tmp_path / "in.npz", tmp_path / "out.npz")
    assert report.missed == ((0, 0),)
    with np.load(tmp_path / "out.npz") as result:
        np.testing.assert_allclose(result["states"][0, 1], content["states"][0, 0], atol=1e-6)


def test_resampling_there_and_back_is_the_identity() -> None:
    """Refining a mesh by two and coarsening it again gives it back; a plane stays a plane."""
    positions = np.random.default_rng(0).normal(size=(36, 3))
    refined = resample_sheet(positions, 11)
    np.testing.assert_allclose(resample_sheet(refined, 6), positions, atol=1e-12)
    flat = flat_positions((6, 6), (1.0, 1.0))
    np.testing.assert_allclose(
        resample_sheet(flat, 9), flat_positions((9, 9), (1.0, 1.0)), atol=1e-12
    )


def test_blender_file_is_understood() -> None:
    """The order of Blender's vertices is read off the flat start of a reference sequence."""
    folder = Path(__file__).parents[2].parent / "shared" / "data" / "blender_reference"
    files = sorted(folder.glob("seq*.npz"))
    if not files:
        pytest.skip(f"no reference sequences in {folder}")
    with np.load(files[0]) as stored:
        states = stored["states"].astype(np.float64)
    order = vertex_order(states[:, 0], 81)
    assert not np.array_equal(order, np.arange(6561))
    later = states[0, 1][order].reshape(81, 81, 3)
    assert np.median(np.linalg.norm(np.diff(later, axis=0), axis=2)) < 2 * 0.0175
