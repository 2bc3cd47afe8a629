"""Terms on where hands grasp and go, beside the arms' reach (ours); see `cost.Term`."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from emd_planner.cost import Term, distance_to_silhouette, look_back
from emd_planner.reach import depth_in_polygon
from emd_planner.silhouette import edge_columns, silhouettes

# Places between grasp and release at which the way is looked at.
_WAY_POINTS = 5


def hem_term(initial: Tensor, tolerance_voxels: int, threshold: float) -> Term:
    """Distance of hands that grasp from the silhouette's edge, summed over hands and steps.

    The robot grips at a hem, which a folded or flat cloth shows at its silhouette's edge.

    Args:
        initial: Initial state, boolean, shape (X, Y, Z).
        tolerance_voxels: See `PlannerConfig.grasp_tolerance_voxels`.
        threshold: Predicted value from which a voxel counts as occupied.
    """

    def cost(states: Tensor, manipulations: Tensor) -> Tensor:
        before, used = look_back(initial, states, manipulations, tolerance_voxels, threshold)
        edge = edge_columns(silhouettes(before))
        points = manipulations[..., :4].unflatten(-1, (2, 2))
        # Nowhere in an edge column is farther than half a column from its middle.
        free = 1.0 / edge.shape[-1]
        return ((distance_to_silhouette(points, edge) - free).clamp_min(0.0) * used).sum((1, 2))

    return cost


def keep_out_term(regions: Sequence[Tensor]) -> Term:
    """How deep grasps, releases and the straight ways between them are in forbidden regions.

    Args:
        regions: Corners of convex polygons, counter-clockwise, normalised, each (N, 2).
    """
    share = torch.linspace(0.0, 1.0, _WAY_POINTS)

    def cost(states: Tensor, manipulations: Tensor) -> Tensor:
        grasps = manipulations[..., :4].unflatten(-1, (2, 2))
        ways = share.to(grasps)[:, None] * manipulations[..., None, None, 4:]
        points = grasps[..., None, :] + ways
        depths = [depth_in_polygon(points, region) for region in regions]
        return torch.stack(depths).sum(0).amax(-1).sum((1, 2))

    return cost


def short_moves_term() -> Term:
    """Length of the displacements, summed over steps, normalised."""

    def cost(states: Tensor, manipulations: Tensor) -> Tensor:
        return manipulations[..., 4:].square().sum(-1).add(1e-12).sqrt().sum(1)

    return cost


def hands_apart_term(
    initial: Tensor, tolerance_voxels: int, threshold: float, distance: float
) -> Term:
    """By how much two hands that grasp are nearer to each other than they may be.

    Both hands share the displacement, so their distance stays what it is at the grasp.

    Args:
        initial: Initial state, boolean, shape (X, Y, Z).
        tolerance_voxels: See `PlannerConfig.grasp_tolerance_voxels`.
        threshold: Predicted value from which a voxel counts as occupied.
        distance: Least distance, normalised.
    """

    def cost(states: Tensor, manipulations: Tensor) -> Tensor:
        _, used = look_back(initial, states, manipulations, tolerance_voxels, threshold)
        between = manipulations[..., 2:4] - manipulations[..., :2]
        missing = (distance - between.square().sum(-1).add(1e-12).sqrt()).clamp_min(0.0)
        return (missing * used.all(-1)).sum(1)

    return cost
