"""What a plan costs: terms that map predicted states and manipulations to a number per restart."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from emd_planner.augmentation import outside_cloth
from emd_planner.losses import state_loss
from emd_planner.reach import ReachLoss
from emd_planner.silhouette import dilate, silhouettes

# Maps predicted states (A, n, X, Y, Z) and manipulations (A, n, 6) to costs (A,).
Term = Callable[[Tensor, Tensor], Tensor]


def goal_term(goal: Tensor) -> Term:
    """loss_s of the last predicted state with respect to the goal (III-C, step 4).

    Args:
        goal: Boolean or real, shape (X, Y, Z).
    """
    wanted = goal.float()

    def cost(states: Tensor, manipulations: Tensor) -> Tensor:
        return state_loss(states[:, -1], wanted)

    return cost


def reach_term(reach: ReachLoss, initial: Tensor, tolerance_voxels: int, threshold: float) -> Term:
    """Distance of grasp and release points from the arms' reach, summed over steps (V-B).

    Which hands grasp cloth is read off the state before each step: the initial one, then the
    predicted ones, so it needs a prediction of every step.

    Args:
        reach: Knows the regions.
        initial: Initial state, boolean, shape (X, Y, Z).
        tolerance_voxels: See `PlannerConfig.grasp_tolerance_voxels`.
        threshold: Predicted value from which a voxel counts as occupied.
    """

    def cost(states: Tensor, manipulations: Tensor) -> Tensor:
        with torch.no_grad():
            before = states_before(initial, states, threshold)
            used = grasps_cloth(manipulations, before, tolerance_voxels)
        return reach(manipulations, used).sum(1)

    return cost


def weighted_sum(terms: list[tuple[float, Term]]) -> Term:
    """Add terms with weights."""

    def cost(states: Tensor, manipulations: Tensor) -> Tensor:
        total = torch.zeros(len(manipulations), device=manipulations.device)
        for weight, term in terms:
            total = total + weight * term(states, manipulations)
        return total

    return cost


def states_before(initial: Tensor, states: Tensor, threshold: float) -> Tensor:
    """Give the state before each step, boolean (A, n, X, Y, Z), from the predicted ones after."""
    first = initial.bool().expand(len(states), 1, *initial.shape)
    return torch.cat([first, states[:, :-1] >= threshold], dim=1)


def grasps_cloth(manipulations: Tensor, states: Tensor, tolerance_voxels: int) -> Tensor:
    """Whether each hand grasps cloth: its point lies on the silhouette or near it.

    Args:
        manipulations: Shape (..., 6).
        states: Before each manipulation, boolean, shape (..., X, Y, Z).
        tolerance_voxels: What counts as near.

    Returns:
        Boolean, shape (..., 2).
    """
    wide = dilate(silhouettes(states), tolerance_voxels)
    points = manipulations[..., :4].unflatten(-1, (2, 2))
    return ~torch.stack([outside_cloth(points[..., hand, :], wide) for hand in range(2)], dim=-1)
