"""Claims about the generator of training sequences."""

import json
from pathlib import Path

import numpy as np
import pytest

from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.config import ClothConfig, HandPathConfig
from emd_cloth_sim.generate import GenerationConfig, generate, shard_path, simulate_sequence
from emd_cloth_sim.random_manipulation import hem_vertices, random_manipulation
from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView
from emd_core.manipulation import Manipulation
from emd_core.voxel_grid import voxelise

CONFIG = GenerationConfig(
    sequences=5,
    steps=2,
    mode="mixed",
    seed=3,
    cloth=ClothConfig(vertices=(11, 11)),
    path=HandPathConfig(),
    shard_size=2,
)


def contents(folder: Path) -> list[dict[str, np.ndarray]]:
    """All shards of a folder."""
    loaded = []
    for path in sorted(folder.glob("*.npz")):
        with np.load(path) as stored:
            loaded.append({key: stored[key] for key in stored})
    return loaded


def test_generator_resumes_to_identical_shards(tmp_path: Path) -> None:
    """A shard lost and made again equals the first one; shards that are there stay untouched."""
    succeeded, failed = generate(CONFIG, tmp_path)
    assert succeeded + failed == 5
    before = contents(tmp_path)
    kept = shard_path(tmp_path, 0).stat().st_mtime_ns
    shard_path(tmp_path, 1).unlink()
    assert sum(generate(CONFIG, tmp_path)) == 2
    assert shard_path(tmp_path, 0).stat().st_mtime_ns == kept
    for old, new in zip(before, contents(tmp_path), strict=True):
        for key in old:
            np.testing.assert_array_equal(old[key], new[key])
    other = GenerationConfig(**{**vars(CONFIG), "seed": 4})
    with pytest.raises(InvalidInputError):
        generate(other, tmp_path)


def test_shard_holds_what_it_says(tmp_path: Path) -> None:
    """Shapes and types are as documented, and grids are those of the states."""
    generate(CONFIG, tmp_path)
    total = 0
    for shard in contents(tmp_path):
        count = len(shard["seeds"])
        total += count + len(json.loads(str(shard["meta"]))["failures"])
        assert shard["grids"].shape == (count, 3, 2048) and shard["grids"].dtype == np.uint8
        assert shard["picks"].shape == (count, 2, 2, 2) and shard["picks"].dtype == np.float32
        assert shard["moves"].shape == (count, 2, 2) and shard["moves"].dtype == np.float32
        assert shard["states"].shape == (count, 3, 121, 3)
        assert shard["states"].dtype == np.float16 and shard["seeds"].dtype == np.int64
        for n in range(count):
            flat = np.unpackbits(shard["grids"][n, 0]).reshape(32, 32, 16).astype(bool)
            wanted = voxelise(Cloth(CONFIG.cloth).top_surface_in_table)
            np.testing.assert_array_equal(flat, wanted.occupancy)
    assert total == 5


def test_sequence_depends_on_seed_and_index_only() -> None:
    """The same index gives the same sequence whatever else is generated."""
    longer = GenerationConfig(**{**vars(CONFIG), "sequences": 100, "shard_size": 16})
    one, other = simulate_sequence(CONFIG, 3), simulate_sequence(longer, 3)
    np.testing.assert_array_equal(one.states, other.states)
    np.testing.assert_array_equal(one.moves, other.moves)
    assert not np.array_equal(one.moves, simulate_sequence(CONFIG, 4).moves)


def test_replaying_a_sample_gives_its_states() -> None:
    """Picks and moves of a sample are what was done to the cloth."""
    from emd_cloth_sim.manipulate import manipulate

    sample = simulate_sequence(CONFIG, 0)
    cloth = Cloth(CONFIG.cloth)
    fov = FieldOfView()
    used = np.isfinite(sample.picks[0]).all(axis=1)
    values = np.concatenate([sample.picks[0].ravel(), sample.moves[0]]).astype(np.float64)
    manipulate(cloth, Manipulation.from_network(values, (used[0], used[1]), fov))
    # float32 grasp points move the outcome a little; crumpling amplifies it, so only roughly.
    got = fov.normalised_from_table(cloth.positions_in_table)
    assert np.abs(got - sample.states[1]).mean() < 0.02


@pytest.mark.parametrize("mode", ["any", "hem", "mixed"])
def test_grasps_lie_on_the_cloth(mode: str) -> None:
    """Every drawn grasp point is a vertex and every length is within 1.4 normalised."""
    cloth = Cloth(CONFIG.cloth)
    fov = FieldOfView()
    rng = np.random.default_rng(0)
    vertices = cloth.positions_in_table[:, :2]
    two_hands = 0
    for _ in range(60):
        manipulation = random_manipulation(cloth, mode, fov, rng)
        two_hands += all(manipulation.used)
        for point, used in zip(manipulation.grasp_points_in_table, manipulation.used, strict=True):
            if used:
                assert np.linalg.norm(vertices - point, axis=1).min() < 1e-12
                if mode == "hem":
                    assert np.abs(point).max() == pytest.approx(0.2)
        length = np.linalg.norm(manipulation.displacement_in_table) / fov.half_extent
        assert (0.1 if mode == "hem" else 0.0) <= length <= 1.4
    assert 15 < two_hands < 45


def test_hem_of_a_flat_cloth_is_its_border() -> None:
    """On the flat cloth the silhouette's edge is exactly the border of the mesh."""
    cloth = Cloth(CONFIG.cloth)
    hem = hem_vertices(cloth.positions_in_table, cloth.triangles, 0.04)
    border = np.flatnonzero(np.abs(cloth.positions_in_table[:, :2]).max(axis=1) > 0.199)
    np.testing.assert_array_equal(hem, border)


def test_unknown_mode_is_rejected() -> None:
    """A mode that does not exist raises InvalidInputError."""
    with pytest.raises(InvalidInputError):
        GenerationConfig(**{**vars(CONFIG), "mode": "neat"})
