"""Silhouettes of batches of grids, and the columns in which points lie; x and y wrap."""

from __future__ import annotations

import functools

import torch
from torch import Tensor


def silhouettes(grids: Tensor) -> Tensor:
    """Give the columns that hold cloth: boolean (..., X, Y) of boolean grids (..., X, Y, Z)."""
    return grids.any(-1)


def dilate(silhouette: Tensor, voxels: int) -> Tensor:
    """Widen boolean silhouettes (..., X, Y) by whole voxels on all sides, wrapped."""
    wide = silhouette
    for axis in (-2, -1):
        shifts = (wide.roll(s, axis) for s in range(-voxels, voxels + 1))
        wide = functools.reduce(torch.logical_or, shifts)  # faster than `any` of a stack
    return wide


def edge_columns(silhouette: Tensor) -> Tensor:
    """Give the columns of boolean silhouettes (..., X, Y) that have an empty one beside them."""
    return silhouette & dilate(~silhouette, 1)


def onto_silhouette(points: Tensor, silhouette: Tensor) -> Tensor:
    """Move points that lie beside a silhouette to the middle of its nearest column.

    Points in the outer half of a column at the silhouette's edge are moved to its middle, too: of
    such a column the cloth may cover a sliver only.

    Args:
        points: Normalised, shape (P, 2).
        silhouette: Boolean, shape (X, Y), X = Y.

    Returns:
        Shape (P, 2); points on the silhouette stay otherwise, and all do if it is empty.
    """
    count = silhouette.shape[-1]
    columns = columns_of(points, count)
    inside = silhouette[columns[:, 0], columns[:, 1]]
    centres = (silhouette.nonzero() + 0.5) * (2.0 / count) - 1.0
    if not len(centres):
        return points
    ways = (centres - points[:, None] + 1.0) % 2.0 - 1.0
    nearest = ways.square().sum(-1).argmin(1)
    moved = centres[nearest]
    return torch.where(inside[:, None], _inwards(points, columns, silhouette), moved)


def _inwards(points: Tensor, columns: Tensor, silhouette: Tensor) -> Tensor:
    """Move points out of the halves of their columns that lie beside an empty column."""
    count = silhouette.shape[-1]
    middles = (columns + 0.5) * (2.0 / count) - 1.0
    offsets = (points - middles + 1.0) % 2.0 - 1.0
    for axis in range(2):
        step = torch.zeros_like(columns)
        step[:, axis] = 1
        beyond, before = ((columns + sign * step) % count for sign in (1, -1))
        open_above = ~silhouette[beyond[:, 0], beyond[:, 1]] & (offsets[:, axis] > 0.0)
        open_below = ~silhouette[before[:, 0], before[:, 1]] & (offsets[:, axis] < 0.0)
        offsets[:, axis] = torch.where(open_above | open_below, 0.0, offsets[:, axis])
    return torch.where((offsets == 0.0), middles, points)


def column_centres(count: int, device: torch.device) -> Tensor:
    """Give the normalised coordinates of the middles of columns along an axis, shape (count,)."""
    return (torch.arange(count, device=device) + 0.5) * (2.0 / count) - 1.0


def columns_of(points: Tensor, count: int) -> Tensor:
    """Give the wrapped column indices, shape (..., 2), of normalised points (..., 2)."""
    return ((points + 1.0) * (count / 2.0)).floor().long() % count


def outside_cloth(points: Tensor, silhouette: Tensor) -> Tensor:
    """Whether points (..., 2) lie outside the cloth of silhouettes (..., X, Y), wrapped."""
    columns = columns_of(points, silhouette.shape[-1])
    flat = columns[..., 0] * silhouette.shape[-1] + columns[..., 1]
    return ~silhouette.flatten(-2).gather(-1, flat[..., None]).squeeze(-1)


def near_cloth(points: Tensor, silhouette: Tensor, voxels: int) -> Tensor:
    """Whether points lie outside the cloth by no more than whole voxels along x and y, wrapped.

    The same as looking the points up in the silhouette widened by `dilate`, in less time.

    Args:
        points: Normalised, shape (..., P, 2).
        silhouette: Boolean, shape (..., X, Y), X = Y, leading axes as those of the points.
        voxels: How far.

    Returns:
        Boolean, shape (..., P).
    """
    count = silhouette.shape[-1]
    steps = torch.arange(-voxels, voxels + 1, device=points.device)
    around = (columns_of(points, count)[..., None] + steps) % count  # (..., P, 2, S)
    flat = around[..., 0, :, None] * count + around[..., 1, None, :]
    found = silhouette.flatten(-2).gather(-1, flat.flatten(-3))
    return found.view(flat.shape).flatten(-2).any(-1)
