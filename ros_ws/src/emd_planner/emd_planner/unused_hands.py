"""Places for the points of hands that grasp nothing (paper, III-A, III-B)."""

from __future__ import annotations

import torch
from torch import Tensor

from emd_planner.silhouette import dilate, silhouettes
from emd_planner.training_config import AugmentationConfig


def fill_unused(
    grids: Tensor, manipulations: Tensor, generator: torch.Generator, margin_voxels: int = 1
) -> Tensor:
    """Put unused points (NaN) at random places outside the cloth (III-A, III-B).

    A NaN displacement (nothing was done) becomes a random one in [-1, 1].

    Args:
        grids: States before the manipulations, shape (B, n, X, Y, Z).
        manipulations: Shape (B, n, 6).
        generator: On the device of the states.
        margin_voxels: Distance kept from the silhouette, which wraps, where there is room.

    Returns:
        Manipulations without NaN.
    """
    points = manipulations[..., :4].unflatten(-1, (2, 2))
    outside = random_points_outside(silhouettes(grids), generator, margin_voxels)
    points = torch.where(points.isnan(), outside, points)
    moves = manipulations[..., 4:]
    random = torch.rand(moves.shape, generator=generator, device=moves.device)
    random = 2.0 * random - 1.0
    moves = torch.where(moves.isnan(), random, moves)
    return torch.cat([points.flatten(-2), moves], dim=-1)


def random_points_outside(
    silhouette: Tensor, generator: torch.Generator, margin_voxels: int = 1
) -> Tensor:
    """Draw two points outside each silhouette, uniformly over the columns without cloth.

    Args:
        silhouette: Boolean, shape (..., X, Y).
        generator: On the device of the silhouette.
        margin_voxels: See `fill_unused`. A silhouette that leaves no room at that distance gets
            points that are merely outside.

    Returns:
        Shape (..., 2, 2), normalised.
    """
    near = dilate(silhouette, margin_voxels)
    return _points_in_best_columns(2.0 * ~silhouette + 1.0 * ~near, generator)


def miss_narrowly(
    grids: Tensor,
    cloth: Tensor,
    manipulations: Tensor,
    config: AugmentationConfig,
    generator: torch.Generator,
) -> Tensor:
    """Put some unused points (NaN) just beside the cloth, where hands grasp nothing too (ours).

    A grid does not show where in a column the cloth ends, and a search that never saw a miss
    there takes the grasp for granted.

    Args:
        grids: States, boolean, shape (B, n+1, X, Y, Z).
        cloth: Points of the cloth, normalised, shape (B, n+1, V, 3); NaN where they are unknown
            and no place can be told to be beside the cloth.
        manipulations: Shape (B, n, 6).
        config: How often, and how far from the cloth.
        generator: On the device of the states.

    Returns:
        Manipulations; points for which no place was found at once stay NaN.
    """
    silhouette = silhouettes(grids[:, :-1])
    band = dilate(silhouette, 1) & dilate(~silhouette, 1)
    places = _points_in_best_columns(1.0 * band, generator)
    ways = (places[..., None, :] - cloth[:, :-1, None, :, :2] + 1.0) % 2.0 - 1.0
    misses = ways.square().sum(-1).amin(-1) > config.near_miss_clearance**2
    drawn = torch.rand(misses.shape, generator=generator, device=misses.device)
    misses &= drawn < config.near_miss_share
    points = manipulations[..., :4].unflatten(-1, (2, 2))
    points = torch.where(points.isnan() & misses[..., None], places, points)
    return torch.cat([points.flatten(-2), manipulations[..., 4:]], dim=-1)


def _points_in_best_columns(score: Tensor, generator: torch.Generator) -> Tensor:
    """Draw two points, uniformly over the columns of the highest score.

    Args:
        score: Whole numbers, shape (..., X, Y).
        generator: On the device of the states.

    Returns:
        Shape (..., 2, 2), normalised.
    """
    device = score.device
    shape = torch.tensor(score.shape[-2:], device=device)
    score = score[..., None, :, :].expand(*score.shape[:-2], 2, *score.shape[-2:])
    drawn = torch.rand(score.shape, generator=generator, device=device)
    best = (score + 0.9 * drawn).flatten(-2).argmax(-1)
    column = torch.stack([best // shape[1], best % shape[1]], dim=-1)
    inside = torch.rand(column.shape, generator=generator, device=device)
    return (column + inside) / shape * 2.0 - 1.0
