"""Voxel grids of batches of point sets, as `emd_core.voxel_grid.voxelise` makes them of one."""

from __future__ import annotations

import torch
from torch import Tensor


def rasterise(points: Tensor, size: tuple[int, int, int], height: float) -> Tensor:
    """Set the voxels in which points fall and all below them; x and y wrap (paper, III-A).

    Args:
        points: Normalised, shape (B, V, 3); repeated points do no harm.
        size: Voxels along x, y and z.
        height: Of the field of view, normalised.

    Returns:
        Boolean, shape (B, X, Y, Z).
    """
    x, y, z = size
    column = ((points[..., 0] + 1.0) * (x / 2.0)).floor().long() % x * y
    column += ((points[..., 1] + 1.0) * (y / 2.0)).floor().long() % y
    layer = (points[..., 2] * (z / height)).floor().long().clamp_(0, z - 1)
    tops = torch.full((len(points), x * y), -1, device=points.device)
    tops.scatter_reduce_(1, column, layer, "amax")
    layers = torch.arange(z, device=points.device)
    return (layers <= tops[..., None]).view(len(points), x, y, z)
