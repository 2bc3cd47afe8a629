"""Silhouettes of batches of grids, and the columns in which points lie; x and y wrap."""

from __future__ import annotations

import torch
from torch import Tensor


def silhouettes(grids: Tensor) -> Tensor:
    """Give the columns that hold cloth: boolean (..., X, Y) of boolean grids (..., X, Y, Z)."""
    return grids.any(-1)


def dilate(silhouette: Tensor, voxels: int) -> Tensor:
    """Widen boolean silhouettes (..., X, Y) by whole voxels on all sides, wrapped."""
    wide = silhouette
    for axis in (-2, -1):
        wide = torch.stack([wide.roll(s, axis) for s in range(-voxels, voxels + 1)]).any(0)
    return wide


def columns_of(points: Tensor, count: int) -> Tensor:
    """Give the wrapped column indices, shape (..., 2), of normalised points (..., 2)."""
    return ((points + 1.0) * (count / 2.0)).floor().long() % count
