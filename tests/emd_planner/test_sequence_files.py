"""Reading of cloth sequences."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView
from emd_core.sequence_split import in_split
from emd_core.voxel_grid import voxelise
from emd_planner.sequence_files import load_sequences

REFERENCE = Path(__file__).parents[2].parent / "shared" / "data" / "blender_reference"


def test_windows_give_the_recorded_states_and_manipulations(shard_directory):
    """A window holds the grids, grasp points and moves of its sequence in their order."""
    data = load_sequences([shard_directory])
    assert len(data) == 12
    assert data.manipulation_count == 36
    with np.load(shard_directory / "shard_0001.npz") as stored:
        grids = np.unpackbits(stored["grids"], axis=-1).reshape(-1, 4, 32, 32, 16).astype(bool)
        picks, moves = stored["picks"], stored["moves"]
    starts = data.window_starts(2)
    assert len(starts) == 24
    windows = data.windows(starts[[12, 13]], 2)  # the first sequence of the second shard
    for row, first in enumerate((0, 1)):
        np.testing.assert_array_equal(windows.grids[row], grids[0, first : first + 3])
        points = picks[0, first : first + 2].reshape(2, 4)
        np.testing.assert_allclose(windows.manipulations[row, :, :4], points, atol=1e-6)
        np.testing.assert_array_equal(
            windows.manipulations[row, :, 4:], moves[0, first : first + 2]
        )


def test_window_past_the_end_stays_at_the_last_state(shard_directory):
    """No window mixes two sequences: after the last state nothing is done."""
    data = load_sequences([shard_directory])
    windows = data.windows(data.window_starts(1)[[2, 5]], 2)
    assert (windows.grids[:, 1] == windows.grids[:, 2]).all()
    assert windows.manipulations[:, 1].isnan().all()
    assert windows.manipulations[:, 0, 4:].isfinite().all()


def test_split_is_by_sequence_and_always_alike(shard_directory):
    """Held-out sequences share no manipulation with the others; the same seed splits alike."""
    data = load_sequences([shard_directory])
    rest, held_out = data.split(0.25, seed=4)
    assert (len(rest), len(held_out)) == (9, 3)
    assert data.split(0.25, seed=4)[1].content_hash == held_out.content_hash
    assert data.split(0.25, seed=5)[1].content_hash != held_out.content_hash
    moves = {bytes(row) for row in rest.manipulations if np.isfinite(row[4])}
    assert len(moves) == rest.manipulation_count
    assert not any(bytes(row) in moves for row in held_out.manipulations)
    with pytest.raises(InvalidInputError, match="both parts"):
        data.split(1.0)


def test_test_sequences_are_kept_from_training(shard_directory):
    """A sequence is in one of the two splits, and which one depends on its index alone."""
    whole = load_sequences([shard_directory])
    train, test = (load_sequences([shard_directory], split=name) for name in ("train", "test"))
    assert len(train) + len(test) == len(whole) and len(train) > len(test)
    kept = {row.tobytes() for row in train.packed_grids} & {r.tobytes() for r in test.packed_grids}
    first = {whole.packed_grids[i].tobytes() for i in whole.first_states}
    assert kept <= first  # the flat cloth, with which they may all begin
    assert sum(in_split(index, "test") for index in range(10_000)) == pytest.approx(1000, abs=100)


def test_sequences_of_different_lengths_go_together(tmp_path, write_shards):
    """Directories with sequences of 3 and of 1 steps make one set."""
    write_shards(tmp_path / "long", 4, length=3)
    write_shards(tmp_path / "short", 6, length=1)
    data = load_sequences([tmp_path / "long", tmp_path / "short"])
    assert len(data.window_starts(1)) == 4 * 3 + 6
    assert len(data.window_starts(2)) == 4 * 2
    assert len(data.window_starts(3)) == 4
    assert data.windows(data.window_starts(1)[-1:], 3).manipulations[0, 1:].isnan().all()


def test_points_are_those_that_the_grids_show(tmp_path, rectangle, grid_of):
    """Vertices of the mid-surface come back raised by half the thickness; clouds mix in size."""
    height = 0.02
    for name, spacing in (("coarse", 0.05), ("fine", 0.02)):
        cloud = rectangle((0.2, 0.1), (0.8, 0.5), height, spacing)
        middle = cloud - [0.0, 0.0, 0.5 * 0.003 / FieldOfView().half_extent]
        grid = np.packbits(grid_of(cloud).occupancy)
        (tmp_path / name).mkdir()
        np.savez(
            tmp_path / name / "shard_0000.npz",
            grids=np.tile(grid, (1, 2, 1)),
            states=np.tile(middle, (1, 2, 1, 1)),
            picks=np.zeros((1, 1, 2, 2)),
            moves=np.zeros((1, 1, 2)),
            meta='{"cloth": {"thickness": 0.003}}',
        )
    data = load_sequences([tmp_path / "coarse", tmp_path / "fine"])
    window = data.windows(data.window_starts(1), 1)
    np.testing.assert_allclose(window.points[..., 2], height, atol=1e-4)
    for points, grid in zip(window.points[:, 0], window.grids[:, 0], strict=True):
        np.testing.assert_array_equal(grid_of(points.numpy()).occupancy, grid)


def test_sequences_without_points_are_mixed_in(tmp_path, write_shards, rectangle, grid_of):
    """They are marked, their points unknown, and only they are counted as without."""
    cloud = rectangle((0.2, 0.1), (0.8, 0.5), 0.02, 0.05)
    (tmp_path / "simulated").mkdir()
    np.savez(
        tmp_path / "simulated" / "shard_0000.npz",
        grids=np.tile(np.packbits(grid_of(cloud).occupancy), (3, 2, 1)),
        states=np.tile(cloud, (3, 2, 1, 1)),
        picks=np.zeros((3, 1, 2, 2)),
        moves=np.zeros((3, 1, 2)),
        meta='{"cloth": {"thickness": 0.003}}',
    )
    write_shards(tmp_path / "recorded", 4, length=2)
    data = load_sequences([tmp_path / "simulated"], mix=[tmp_path / "recorded"])
    assert data.mixed.tolist() == [False] * 3 + [True] * 4
    assert data.pointless_count == 8
    assert len(data.window_starts(1, mixed=False)) == 3
    windows = data.windows(data.window_starts(1, mixed=True), 1)
    assert len(windows.grids) == 8 and windows.points.isnan().all()
    assert data.windows(data.window_starts(1, mixed=False), 1).points.isfinite().all()
    assert data.subset(np.array([6, 0])).mixed.tolist() == [True, False]
    assert load_sequences([tmp_path / "recorded"]).points is None


def test_shards_without_sequences_are_passed_over(tmp_path, write_shards):
    """A shard whose sequences all failed adds nothing."""
    write_shards(tmp_path, 2)
    np.savez(
        tmp_path / "shard_0009.npz",
        grids=np.zeros((0, 4, 2048), np.uint8),
        picks=np.zeros((0, 3, 2, 2), np.float32),
        moves=np.zeros((0, 3, 2), np.float32),
    )
    data = load_sequences([tmp_path])
    assert len(data) == 2
    assert len(data.window_starts(1)) == 6


def test_authors_files_are_rasterised():
    """A reference sequence gives the grids of its vertices, with hands wrapped into view."""
    if not REFERENCE.is_dir():
        pytest.skip("the reference sequences are not at hand")
    data = load_sequences([REFERENCE])
    assert len(data) == 101
    path = sorted(REFERENCE.glob("*.npz"))[0]
    with np.load(path) as stored:
        states, picks = stored["states"].astype(float), stored["picks"]
    window = data.windows(data.window_starts(3)[:1], 3)
    for grid, state in zip(window.grids[0], states[0], strict=True):
        wanted = voxelise(state * FieldOfView().half_extent).occupancy
        # Half-precision vertices often lie exactly between voxels, where rounding decides.
        assert (grid.numpy() != wanted).sum() <= 4
    np.testing.assert_array_equal(
        np.isnan(window.manipulations[0, :, :4]), np.isnan(picks[0].reshape(3, 4))
    )
    points = data.manipulations[:, :4]
    assert np.nanmax(np.abs(points)) <= 1.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"grids": np.zeros((2, 4, 100), np.uint8)}, "grids must be"),
        ({"grids": np.zeros((2, 3, 2048), np.uint8)}, "grids must be"),
        ({"moves": np.zeros((2, 3), np.float32)}, "moves must be"),
        ({"moves": np.full((2, 3, 2), np.nan, np.float32)}, "finite move"),
        ({"picks": np.zeros((2, 3, 2), np.float32)}, "picks must be"),
        ({"picks": np.full((2, 3, 2, 2), np.nan, np.float32)}, "needs a pick"),
        ({"picks": np.full((2, 3, 2, 2), np.inf, np.float32)}, "finite, or NaN"),
        ({"picks": None}, "should be an .npz"),
    ],
)
def test_bad_files_are_refused(tmp_path, change, message):
    """A file that lacks an array or has one of a wrong form is named with what is wrong."""
    arrays = {
        "grids": np.zeros((2, 4, 2048), np.uint8),
        "picks": np.zeros((2, 3, 2, 2), np.float32),
        "moves": np.zeros((2, 3, 2), np.float32),
        **change,
    }
    kept = {name: value for name, value in arrays.items() if value is not None}
    np.savez(tmp_path / "shard_0000.npz", **kept)
    with pytest.raises(InvalidInputError, match=message) as raised:
        load_sequences([tmp_path])
    assert "shard_0000.npz" in str(raised.value)


def test_missing_and_broken_files_are_refused(tmp_path):
    """An empty directory and a file that is no archive are refused with the remedy."""
    with pytest.raises(InvalidInputError, match="found none"):
        load_sequences([tmp_path])
    (tmp_path / "shard_0000.npz").write_bytes(b"PK\x03\x04 broken")
    with pytest.raises(InvalidInputError, match="make the data again"):
        load_sequences([tmp_path])
    with pytest.raises(InvalidInputError, match="at least one"):
        load_sequences([])
