"""The cost of one planning problem: the goal, and the terms that have a weight."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from torch import Tensor

from emd_core.frames import FieldOfView
from emd_core.reach_map import ReachMap
from emd_planner.config import PlannerConfig, Polygon, ReachConfig
from emd_planner.cost import (
    Term,
    expected_goal_term,
    goal_term,
    grasp_term,
    reach_term,
    silhouette_term,
    weighted_sum,
)
from emd_planner.motion_cost import hands_apart_term, hem_term, keep_out_term, short_moves_term
from emd_planner.reach import ReachLoss, normalised_polygon


@dataclass(frozen=True)
class PlanCost:
    """What a search lowers.

    Attributes:
        total: Weighted sum of all terms.
        reach: Knows the arms' regions; None without reach limits.
        needs_every_state: Whether a term looks at states before the last one.
    """

    total: Term
    reach: ReachLoss | None
    needs_every_state: bool


def plan_cost(
    config: PlannerConfig,
    initial: Tensor,
    goal: Tensor,
    field_of_view: FieldOfView,
    reach: ReachConfig | ReachMap | None = None,
    keep_out: Sequence[Polygon] = (),
    goal_known: Tensor | None = None,
) -> PlanCost:
    """Put the terms of a problem together.

    Args:
        config: Weights.
        initial: What of the initial state can be grasped, boolean, shape (X, Y, Z).
        goal: Wanted state, likewise.
        field_of_view: Of both.
        reach: Where the arms can grasp and release; None: anywhere.
        keep_out: Corners of convex regions to keep out of, metres, table frame.
        goal_known: Columns of the goal that count, boolean, shape (X, Y); all if None.

    Raises:
        InvalidInputError: If a region is not convex.
    """
    looks = (initial, config.grasp_tolerance_voxels, config.threshold)
    apart = config.hands_apart / field_of_view.half_extent
    regions = [normalised_polygon(region, field_of_view).to(initial.device) for region in keep_out]
    optional: list[tuple[float, Callable[[], Term]]] = [
        (config.grasp_weight, lambda: grasp_term(*looks)),
        (config.silhouette_weight, lambda: silhouette_term(goal, goal_known)),
        (config.hem_weight, lambda: hem_term(*looks)),
        (config.move_weight, short_moves_term),
        (config.hands_apart_weight, lambda: hands_apart_term(*looks, apart)),
        (config.keep_out_weight if regions else 0.0, lambda: keep_out_term(regions)),
    ]
    goal_cost = goal_term if config.goal_cost == "squared" else expected_goal_term
    terms = [(1.0, goal_cost(goal, goal_known))]
    terms += [(weight, make()) for weight, make in optional if weight > 0.0]
    loss = None
    if reach is not None:
        loss = ReachLoss(reach, field_of_view, initial.device, config.arms_may_cross)
        terms.append((config.reach_weight, reach_term(loss, *looks)))
    return PlanCost(weighted_sum(terms), loss, len(terms) > 1)
