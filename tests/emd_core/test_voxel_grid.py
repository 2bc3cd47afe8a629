"""Voxel grids: rasterisation as III-A says, and files that are whole."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView
from emd_core.voxel_grid import VoxelGrid, fill_occluded, voxelise

FOV = FieldOfView()


def test_a_point_sets_its_voxel_and_all_below_it() -> None:
    """A vertex marks its voxel; what lies under it is occluded and marked too."""
    centre = FOV.origin + (np.array([3, 20, 5]) + 0.5) * FOV.resolution
    grid = voxelise(centre[None], FOV)
    assert grid.occupancy[3, 20, :6].all()
    assert grid.occupancy.sum() == 6


def test_paper_units_map_to_the_paper_voxels() -> None:
    """The flat cloth of IV-A at z = 0.03 covers 1.4 / 2 of each side and lies in layer 1."""
    side = np.linspace(-0.7, 0.7, 81)
    x, y = np.meshgrid(side, side, indexing="ij")
    flat = np.stack([x, y, np.full_like(x, 0.03)], axis=-1).reshape(-1, 3)
    grid = voxelise(FOV.table_from_normalised(flat), FOV)
    assert grid.occupancy.sum() == 2 * grid.silhouette.sum()
    assert np.isclose(grid.silhouette.sum() / 32**2, 0.7**2, atol=0.08)


@settings(max_examples=30, deadline=None)
@given(st.integers(-40, 40), st.integers(-40, 40), st.integers(0, 2**32 - 1))
def test_shifting_points_by_whole_voxels_rolls_the_grid(dx: int, dy: int, seed: int) -> None:
    """X and y are periodic: a shift by whole voxels is a cyclic shift of the grid."""
    rng = np.random.default_rng(seed)
    index = rng.integers(0, (32, 32, 16), (50, 3))
    points = FOV.origin + (index + rng.uniform(0.1, 0.9, index.shape)) * FOV.resolution
    moved = points + np.array([dx, dy, 0]) * FOV.resolution
    rolled = np.roll(voxelise(points, FOV).occupancy, (dx, dy), axis=(0, 1))
    assert (voxelise(moved, FOV).occupancy == rolled).all()


def test_z_is_stretched_so_that_voxels_are_cubes_of_normalised_units() -> None:
    """Z times 4 makes the three edges equal (III-A)."""
    edges = FOV.resolution * np.array([1, 1, FOV.z_scale])
    assert np.allclose(edges, edges[0])
    assert FOV.z_scale == 4.0


def test_a_pile_above_the_box_is_not_lost() -> None:
    """A point above the box fills its column instead of leaving it empty."""
    grid = voxelise(np.array([[0.0, 0.0, 1.0]]), FOV)
    assert grid.occupancy.sum() == 16


def test_filling_twice_changes_nothing() -> None:
    """The occlusion fill is idempotent and never clears a voxel."""
    occupancy = np.random.default_rng(0).random((8, 8, 6)) < 0.1
    filled = fill_occluded(occupancy)
    assert (fill_occluded(filled) == filled).all()
    assert filled[occupancy].all()


def test_save_and_load_there_and_back_again(tmp_path) -> None:
    """A saved grid is the loaded grid, its metric size included."""
    occupancy = np.random.default_rng(1).random(FOV.size) < 0.2
    grid = VoxelGrid(occupancy, FieldOfView(half_extent=0.4))
    grid.save(tmp_path / "grid.npz")
    loaded = VoxelGrid.load(tmp_path / "grid.npz")
    assert (loaded.occupancy == occupancy).all()
    assert loaded.field_of_view == grid.field_of_view
    assert [file.name for file in tmp_path.iterdir()] == ["grid.npz"]


@pytest.mark.parametrize("content", [b"", b"not a zip", None])
def test_an_unreadable_file_is_the_users_error(tmp_path, content) -> None:
    """A missing, empty or foreign file is refused with its name."""
    file = tmp_path / "grid.npz"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(InvalidInputError, match="grid.npz"):
        VoxelGrid.load(file)


@pytest.mark.parametrize(
    "points", [np.zeros((3, 2)), np.array([[0, 0, np.nan]]), np.array([[np.inf, 0, 0]])]
)
def test_bad_points_are_refused(points) -> None:
    """Wrong shapes, NaN and infinity are refused."""
    with pytest.raises(InvalidInputError):
        voxelise(points)


def test_a_grid_of_another_size_is_refused() -> None:
    """Occupancy and field of view must agree."""
    with pytest.raises(InvalidInputError, match="32"):
        VoxelGrid(np.zeros((16, 32, 16), dtype=bool))


def test_unknown_columns_are_kept_in_files(tmp_path) -> None:
    """A grid whose columns are not all known is read as it was written, others without them."""
    occupancy = np.zeros((32, 32, 16), bool)
    unknown = np.random.default_rng(0).random((32, 32)) < 0.1
    for grid in (VoxelGrid(occupancy, FOV, unknown), VoxelGrid(occupancy, FOV)):
        grid.save(tmp_path / "grid.npz")
        again = VoxelGrid.load(tmp_path / "grid.npz")
        np.testing.assert_array_equal(again.unknown, grid.unknown)
        assert again.unknown_count == grid.unknown_count


@pytest.mark.parametrize("unknown", [np.zeros((32, 16), bool), np.zeros((32, 32), np.uint8)])
def test_unknown_columns_of_another_shape_or_type_are_refused(unknown) -> None:
    """The mask must fit the grid."""
    with pytest.raises(InvalidInputError, match="unknown columns"):
        VoxelGrid(np.zeros((32, 32, 16), bool), FOV, unknown)
