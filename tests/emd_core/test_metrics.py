"""The metrics' known values and symmetries."""

import numpy as np
import pytest

from emd_core.errors import InvalidInputError
from emd_core.metrics import silhouette_iou, voxel_iou, voxel_mse
from emd_core.voxel_grid import VoxelGrid


def grid(seed: int) -> VoxelGrid:
    """A random grid."""
    return VoxelGrid(np.random.default_rng(seed).random((32, 32, 16)) < 0.1)


def test_a_grid_equals_itself() -> None:
    """MSE 0 and IoU 1 to itself."""
    assert voxel_mse(grid(0), grid(0)) == 0
    assert voxel_iou(grid(0), grid(0)) == silhouette_iou(grid(0), grid(0)) == 1


def test_mse_of_binary_grids_is_the_share_of_differing_voxels() -> None:
    """Equation 1 over 16384 voxels, by NumPy."""
    a, b = grid(1), grid(2)
    expected = np.mean((a.occupancy.astype(float) - b.occupancy.astype(float)) ** 2)
    assert voxel_mse(a, b) == pytest.approx(expected)
    assert voxel_mse(a, b) == voxel_mse(b, a)


def test_what_was_hidden_in_the_goal_does_not_count() -> None:
    """Differences in columns whose wanted state nobody knows are left out."""
    seen, goal = grid(1), grid(2)
    unknown = np.zeros(goal.occupancy.shape[:2], dtype=bool)
    unknown[:5] = True
    partly = VoxelGrid(goal.occupancy, goal.field_of_view, unknown)
    assert voxel_mse(seen, partly) == (seen.occupancy != goal.occupancy)[5:].mean()
    hidden = VoxelGrid(goal.occupancy, goal.field_of_view, np.ones_like(unknown))
    with pytest.raises(InvalidInputError, match="something hid all of it"):
        voxel_mse(seen, hidden)


def test_empty_grids_agree() -> None:
    """Two empty grids have IoU 1, an empty and a full one 0."""
    empty = VoxelGrid(np.zeros((32, 32, 16), dtype=bool))
    full = VoxelGrid(np.ones((32, 32, 16), dtype=bool))
    assert voxel_iou(empty, empty) == 1
    assert voxel_iou(empty, full) == silhouette_iou(full, empty) == 0
