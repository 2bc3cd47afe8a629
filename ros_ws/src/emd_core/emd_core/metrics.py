"""How far one voxel grid is from another."""

from __future__ import annotations

from emd_core.errors import InvalidInputError
from emd_core.voxel_grid import VoxelGrid


def voxel_mse(grid: VoxelGrid, goal: VoxelGrid) -> float:
    """Mean squared difference of corresponding voxels, 0..1 (paper, eq. 1 and V-A).

    Columns that something hid when the goal was seen are left out: what is wanted there is not
    known. 0 if nothing is known.
    """
    _check_same_size(grid, goal)
    wrong = grid.occupancy != goal.occupancy
    if goal.unknown is not None:
        wrong = wrong[~goal.unknown]
    return float(wrong.mean()) if wrong.size else 0.0


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
