"""The cloth's outline as a metric mask."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from emd_arm_executor.observed_silhouette import silhouette_from_points
from emd_arm_executor.silhouette import Silhouette
from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView
from emd_core.voxel_grid import voxelise


def _square(centre: tuple[float, float], side: float = 0.2, height: float = 0.004) -> np.ndarray:
    axis = np.linspace(-side / 2, side / 2, 80)
    x, y = np.meshgrid(axis, axis, indexing="ij")
    return np.stack([x + centre[0], y + centre[1], np.full_like(x, height)], axis=-1).reshape(
        -1, 3
    )


def _middle(silhouette: Silhouette) -> np.ndarray:
    cells = np.argwhere(silhouette.mask)
    return silhouette.origin_in_table + (cells.mean(axis=0) + 0.5) * silhouette.resolution


@pytest.mark.parametrize("centre", [(0.0, 0.0), (0.05, -0.1), (0.26, 0.0), (-0.24, 0.27)])
def test_wrapped_cloth_is_laid_out_in_one_piece(centre: tuple[float, float]) -> None:
    """A cloth that leaves the field of view is put together where it really lies."""
    silhouette = Silhouette.from_voxel_grid(voxelise(_square(centre)))
    assert _middle(silhouette) == pytest.approx(centre, abs=0.01)
    spans = np.ptp(np.argwhere(silhouette.mask), axis=0) + 1
    assert (spans * silhouette.resolution <= 0.2 + 2 * silhouette.resolution).all()


def test_heights_move_with_the_mask() -> None:
    """Unwrapping keeps every height with its cell."""
    grid = voxelise(_square((0.27, 0.0), height=0.03))
    silhouette = Silhouette.from_voxel_grid(grid)
    assert silhouette.heights is not None
    assert (silhouette.heights[silhouette.mask] > 0.03).all()
    assert (silhouette.heights[~silhouette.mask] == 0).all()
    assert silhouette.top == grid.height_map.max()


def test_height_near_sees_only_its_surroundings() -> None:
    """The height near a point is that of cloth within the radius, 0 where there is none."""
    points = np.concatenate([_square((-0.1, 0.0)), _square((0.1, 0.1), 0.04, 0.05)])
    silhouette = Silhouette.from_voxel_grid(voxelise(points))
    cell = FieldOfView().resolution[2]
    assert silhouette.height_near([0.1, 0.1], 0.01) == pytest.approx(0.05, abs=cell)
    assert silhouette.height_near([-0.15, -0.05], 0.01) == pytest.approx(cell)
    assert silhouette.height_near([0.25, -0.25], 0.01) == 0.0


@pytest.mark.parametrize("from_points", [False, True])
def test_what_lies_beside_hidden_columns_is_told(from_points: bool) -> None:
    """A place in a hidden column, and one before it, is hidden; the other sides are not."""
    points = _square((0.0, 0.0))
    grid = voxelise(points)
    fov = grid.field_of_view
    unknown = np.zeros(fov.size[:2], dtype=bool)
    first = int(np.ceil((0.1 - fov.origin[0]) / fov.resolution[0]))
    unknown[first:] = True  # from just beyond the side towards +x on
    grid = replace(grid, unknown=unknown)
    silhouette = (
        silhouette_from_points(points, grid=grid)
        if from_points
        else Silhouette.from_voxel_grid(grid)
    )
    edge = fov.origin[0] + first * fov.resolution[0]
    assert silhouette.is_hidden([edge - 0.01, 0.05], [1.0, 0.0], 0.025)
    assert not silhouette.is_hidden([edge - 0.04, 0.05], [1.0, 0.0], 0.025)
    for side in ([-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]):
        assert not silhouette.is_hidden(0.09 * np.array(side), side, 0.025)
    known = silhouette_from_points(points, grid=voxelise(points))
    assert not known.is_hidden([edge + 0.01, 0.0], [1.0, 0.0], 0.025)


def test_hidden_columns_move_with_the_mask() -> None:
    """A cloth that leaves the field of view keeps what hides its edge beside it."""
    grid = voxelise(_square((0.26, 0.0)))
    fov = grid.field_of_view
    beyond = int((0.38 - fov.origin[0]) / fov.resolution[0]) % fov.size[0]
    unknown = np.zeros(fov.size[:2], dtype=bool)
    unknown[beyond] = True
    silhouette = Silhouette.from_voxel_grid(replace(grid, unknown=unknown))
    assert silhouette.is_hidden([0.355, 0.0], [1.0, 0.0], 0.025)
    assert not silhouette.is_hidden([0.165, 0.0], [-1.0, 0.0], 0.025)


def test_mask_without_heights_is_flat() -> None:
    """A bare mask counts as lying on the table."""
    silhouette = Silhouette(np.ones((4, 4), dtype=bool), np.array([0.01, 0.01]), np.zeros(2))
    assert silhouette.top == 0.0
    assert silhouette.height_near([0.02, 0.02], 0.05) == 0.0


@pytest.mark.parametrize(
    "arguments",
    [
        {"mask": np.ones((4, 4))},
        {"mask": np.ones(4, dtype=bool)},
        {"resolution": np.array([0.01, 0.0])},
        {"origin_in_table": np.zeros(3)},
        {"heights": np.zeros((2, 2))},
    ],
)
def test_unusable_arrays_are_refused(arguments: dict) -> None:
    """Wrong shapes and types say what is wanted."""
    good = {
        "mask": np.ones((4, 4), dtype=bool),
        "resolution": np.array([0.01, 0.01]),
        "origin_in_table": np.zeros(2),
    }
    with pytest.raises(InvalidInputError):
        Silhouette(**{**good, **arguments})


def test_height_near_looks_at_every_cell_within_the_radius() -> None:
    """Random heights and places, beside the mask too, give what a look at all cells gives."""
    rng = np.random.default_rng(0)
    resolution, origin = np.array([0.01, 0.015]), np.array([-0.1, -0.2])
    mask = rng.random((20, 30)) < 0.7
    silhouette = Silhouette(mask, resolution, origin, np.where(mask, rng.random(mask.shape), 0.0))
    cells = np.argwhere(mask)
    centres = origin + (cells + 0.5) * resolution
    for _ in range(200):
        point, radius = rng.uniform(-0.3, 0.4, 2), rng.uniform(0.0, 0.1)
        near = np.linalg.norm(centres - point, axis=1) <= radius + 0.0075
        expected = max((silhouette.heights[tuple(cell)] for cell in cells[near]), default=0.0)
        assert silhouette.height_near(point, radius) == expected


def test_points_are_covered_by_the_cell_they_lie_in() -> None:
    """Also at the edges between cells; what lies outside the raster is bare."""
    mask = np.array([[True, False], [False, True]])
    silhouette = Silhouette(mask, np.array([0.01, 0.02]), np.array([-0.01, 0.0]))
    places = [[-0.005, 0.01], [-0.005, 0.03], [0.0, 0.02], [0.011, 0.03], [-0.011, 0.01]]
    assert silhouette.covers(np.array(places)).tolist() == [True, False, True, False, False]
