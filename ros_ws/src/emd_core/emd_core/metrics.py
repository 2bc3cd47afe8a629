"""How far one voxel grid is from another."""

from __future__ import annotations

from emd_core.errors import InvalidInputError
from emd_core.voxel_grid import VoxelGrid


def voxel_mse(grid: VoxelGrid, goal: VoxelGrid) -> float:
    """Mean squared difference of corresponding voxels, 0..1 (paper, eq. 1 and V-A).

    Columns that something hid when the goal was seen are left out: what is wanted there is not
    known.

    Raises:
        InvalidInputError: If the grids differ in size, or all of the goal was hidden.
    """
    _check_same_size(grid, goal)
    wrong = grid.occupancy != goal.occupancy
    if goal.unknown is not None:
        wrong = wrong[~goal.unknown]
    if not wrong.size:
        raise InvalidInputError(
            "a goal of which something is known is wanted, but something hid all of it; see the "
            "goal again with nothing in the camera's way"
        )
    return float(wrong.mean())


def voxel_iou(grid: VoxelGrid, goal: VoxelGrid) -> float:
    """Intersection over union of the occupied voxels, 0..1; 1 if both grids are empty."""
    _check_same_size(grid, goal)
    union = (grid.occupancy | goal.occupancy).sum()
    return float((grid.occupancy & goal.occupancy).sum() / union) if union else 1.0


def silhouette_iou(grid: VoxelGrid, goal: VoxelGrid) -> float:
    """Intersection over union of the occupied columns, not re-aligned, 0..1; 1 if both empty."""
    _check_same_size(grid, goal)
    union = (grid.silhouette | goal.silhouette).sum()
    return float((grid.silhouette & goal.silhouette).sum() / union) if union else 1.0


def _check_same_size(grid: VoxelGrid, goal: VoxelGrid) -> None:
    if grid.occupancy.shape != goal.occupancy.shape:
        raise InvalidInputError(
            f"both grids must have the same size, got {grid.occupancy.shape} and "
            f"{goal.occupancy.shape}; voxelise both with one field of view"
        )
