"""What a plan costs: terms that map predicted states and manipulations to a number per restart."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from emd_planner.losses import state_loss
from emd_planner.reach import ReachLoss
from emd_planner.silhouette import column_centres, dilate, near_cloth, silhouettes

# Maps predicted states (A, n, X, Y, Z) and manipulations (A, n, 6) to costs (A,).
Term = Callable[[Tensor, Tensor], Tensor]


def goal_term(goal: Tensor, known: Tensor | None = None) -> Term:
    """loss_s of the last predicted state with respect to the goal (III-C, step 4).

    Args:
        goal: Boolean or real, shape (X, Y, Z).
        known: Columns of the goal that count, boolean, shape (X, Y); all if None.
    """
    columns = slice(None) if known is None else known
    wanted = goal.float()[columns]

    def cost(states: Tensor, manipulations: Tensor) -> Tensor:
        return state_loss(states[:, -1][:, columns], wanted)

    return cost


def expected_goal_term(goal: Tensor, known: Tensor | None = None) -> Term:
    """Mean squared error to be expected of the outcome if the probabilities are right (ours).

    A voxel that is occupied with probability p differs from the goal's g with probability
    p (1 - g) + (1 - p) g, which is (p - g)^2 + p (1 - p): loss_s and what the net is unsure of.

    Args:
        goal: Boolean or real, shape (X, Y, Z).
        known: Columns of the goal that count, boolean, shape (X, Y); all if None.
    """
    columns = slice(None) if known is None else known
    wanted = goal.float()
    slope, start = (1.0 - 2.0 * wanted) / wanted[columns].numel(), wanted[columns].mean()
    if known is not None:
        slope = slope * known[..., None]

    def cost(states: Tensor, manipulations: Tensor) -> Tensor:
        return (states[:, -1] * slope).flatten(1).sum(1) + start

    return cost


def silhouette_term(goal: Tensor, known: Tensor | None = None) -> Term:
    """Mean squared difference of the last state's silhouette and the goal's (ours).

    Columns are filled from the desk, so the lowest voxel of a column is the silhouette.

    Args:
        goal: Boolean or real, shape (X, Y, Z).
        known: Columns of the goal that count, boolean, shape (X, Y); all if None.
    """
    columns = slice(None) if known is None else known
    wanted = goal[..., 0].float()[columns]

    def cost(states: Tensor, manipulations: Tensor) -> Tensor:
        return (states[:, -1, :, :, 0][:, columns] - wanted).square().flatten(1).mean(1)

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
        _, used = look_back(initial, states, manipulations, tolerance_voxels, threshold)
        return reach(manipulations, used).sum(1)

    return cost


def grasp_term(initial: Tensor, tolerance_voxels: int, threshold: float) -> Term:
    """Distance from the cloth of the nearer hand, summed over the steps in which none grasps it.

    Ours: off the cloth the net learned that nothing happens, which an unsure net may rate better
    than any fold, but a step without a grasp is no step. 0 as soon as one hand is on the cloth.

    Args:
        initial: Initial state, boolean, shape (X, Y, Z).
        tolerance_voxels: See `PlannerConfig.grasp_tolerance_voxels`.
        threshold: Predicted value from which a voxel counts as occupied.
    """

    def cost(states: Tensor, manipulations: Tensor) -> Tensor:
        before, used = look_back(initial, states, manipulations, tolerance_voxels, threshold)
        missing = ~used.any(-1)
        if not missing.any():  # nearly always
            return torch.zeros(len(manipulations), device=manipulations.device)
        wide = dilate(silhouettes(before), tolerance_voxels)
        points = manipulations[..., :4].unflatten(-1, (2, 2))
        distance = distance_to_silhouette(points[missing], wide[missing]).amin(-1)
        return distance.new_zeros(missing.shape).masked_scatter(missing, distance).sum(1)

    return cost


def distance_to_silhouette(points: Tensor, silhouette: Tensor) -> Tensor:
    """Distance of points to the centre of the nearest column with cloth, wrapped.

    Args:
        points: Normalised, shape (..., H, 2).
        silhouette: Boolean, shape (..., X, Y), leading axes as those of the points.

    Returns:
        Normalised, shape (..., H); 0 where a silhouette is empty, as no way leads to it.
    """
    count = silhouette.shape[-1]
    centres = column_centres(count, points.device)
    offsets = (points[..., None] - centres + 1.0) % 2.0 - 1.0  # (..., H, 2, count)
    squares = offsets.square()
    squared = squares[..., 0, :, None] + squares[..., 1, None, :]
    squared = torch.where(silhouette[..., None, :, :], squared, torch.inf).flatten(-2).amin(-1)
    empty = squared.isinf()
    return torch.where(empty, 0.0, torch.where(empty, 1.0, squared).clamp_min(1e-12).sqrt())


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


@torch.no_grad()
def look_back(
    initial: Tensor, states: Tensor, manipulations: Tensor, tolerance_voxels: int, threshold: float
) -> tuple[Tensor, Tensor]:
    """Give the states before each step, see `states_before`, and which hands grasp cloth there.

    Returns:
        Boolean, shapes (A, n, X, Y, Z) and (A, n, 2).
    """
    before = states_before(initial, states, threshold)
    return before, grasps_cloth(manipulations, before, tolerance_voxels)


def grasps_cloth(manipulations: Tensor, states: Tensor, tolerance_voxels: int) -> Tensor:
    """Whether each hand grasps cloth: its point lies on the silhouette or near it.

    Args:
        manipulations: Shape (..., 6).
        states: Before each manipulation, boolean, shape (..., X, Y, Z).
        tolerance_voxels: What counts as near.

    Returns:
        Boolean, shape (..., 2).
    """
    points = manipulations[..., :4].unflatten(-1, (2, 2))
    return near_cloth(points, silhouettes(states), tolerance_voxels)
