"""Moves a planned manipulation into the arms' reach, so that it can be executed (ours).

The reach loss (paper, V-B) is one cost among others: where a goal asks for it, a search leaves the
reach a little. What is left of that is taken back here, by projections onto the arms' regions.
"""

from __future__ import annotations

import torch
from torch import Tensor

from emd_planner.arm_reach import Region
from emd_planner.reach import ReachLoss
from emd_planner.silhouette import onto_silhouette

_ROUNDS = 200  # of projections onto the regions of two hands that share a displacement


def into_reach(
    manipulation: Tensor, used: Tensor, reach: ReachLoss, silhouette: Tensor | None = None
) -> Tensor:
    """Move grasps, then releases, as little as puts them within the reach of their arms.

    A displacement of nothing is always possible, so there is always an answer.

    Args:
        manipulation: Shape (6,), normalised.
        used: Which hands grasp cloth, boolean, shape (2,); the others' points stay.
        reach: Knows the regions.
        silhouette: Boolean (X, Y); grasps go to the nearest column of it that is within reach, if
            there is one; None: to the nearest place.

    Returns:
        Shape (6,); the manipulation itself if it was within reach.
    """
    excess, regions = reach.assigned(manipulation, used)
    if excess == 0.0:
        return manipulation
    grasps = manipulation[:4].view(2, 2).clone()
    for hand in used.nonzero().flatten().tolist():
        grasps[hand] = _grasp_within(grasps[hand], regions[hand][0], silhouette)
    move = manipulation[4:]
    for _ in range(_ROUNDS):
        before = move
        for hand in used.nonzero().flatten().tolist():
            move = regions[hand][1].nearest(grasps[hand] + move) - grasps[hand]
        if torch.equal(move, before):
            break
    else:
        move = torch.zeros_like(move)
    return torch.cat([grasps.flatten(), move])


def _grasp_within(point: Tensor, region: Region, silhouette: Tensor | None) -> Tensor:
    inside = region.nearest(point)
    if silhouette is None or torch.equal(inside, point):
        return inside
    reached = silhouette & region.columns(silhouette.shape[-1])
    return onto_silhouette(inside[None], reached)[0] if reached.any() else inside
