"""From an initial and a goal state to manipulations: the planner as a whole (paper, III-C)."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Sequence

from emd_core.errors import InvalidInputError, NoPlanError
from emd_core.reach_map import ReachMap
from emd_core.voxel_grid import VoxelGrid
from emd_planner.config import PlannerConfig, Polygon, ReachConfig
from emd_planner.fold_plan import FoldPlan, PlanningProgress
from emd_planner.interruption import Watch
from emd_planner.planning_problem import Candidate, PlanningProblem
from emd_planner.state_predictor import StatePredictor


def plan(
    net: StatePredictor,
    initial: VoxelGrid,
    goal: VoxelGrid,
    steps: int,
    config: PlannerConfig | None = None,
    reach: ReachConfig | ReachMap | None = None,
    seed: int = 0,
    on_iteration: Callable[[PlanningProgress], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
    keep_out: Sequence[Polygon] = (),
) -> FoldPlan:
    """Find manipulations that lead from the initial to the goal state.

    Args:
        net: Trained; see `load_net`.
        initial: The cloth as it lies.
        goal: The cloth as it shall lie.
        steps: Manipulations in the plan; 0: as few as come near the best of 1 to
            `config.max_steps`.
        config: Settings of the search.
        reach: Where the arms can grasp and release; None: anywhere.
        seed: Of the random starts; the same call with the same seed gives the same plan (unless
            the time budget ends it).
        on_iteration: Told of the progress after every iteration.
        should_stop: Asked between the layers of the net, so every few milliseconds.
        keep_out: Corners (x, y) of convex regions, metres, table frame, in which no hand shall
            grasp, release or pass.

    Raises:
        InvalidInputError: If grids, net and steps do not fit each other.
        CancelledError: If `should_stop` says so.
        NoPlanError: If no restart ended with a grasp on the cloth, within reach if points must
            keep there, in every step, or the time budget was spent before any had been rated.
    """
    return alternatives(
        net, initial, goal, steps, 1, config, reach, seed, on_iteration, should_stop, keep_out
    )[0]


def alternatives(
    net: StatePredictor,
    initial: VoxelGrid,
    goal: VoxelGrid,
    steps: int,
    count: int,
    config: PlannerConfig | None = None,
    reach: ReachConfig | ReachMap | None = None,
    seed: int = 0,
    on_iteration: Callable[[PlanningProgress], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
    keep_out: Sequence[Polygon] = (),
) -> list[FoldPlan]:
    """Find several plans from one search, the one that `plan` gives first.

    The others are the best of other restarts and have as many steps. `count` is the most that are
    given; the other arguments and the errors are those of `plan`.
    """
    started = time.monotonic()
    config = config or PlannerConfig()
    _check(net, initial, goal, steps)
    problem = PlanningProblem(net, initial, goal, config, reach, keep_out, on_iteration)
    tried = [steps] if steps > 0 else list(range(1, config.max_steps + 1))
    best: list[list[Candidate]] = []
    rated = False
    for number, length in enumerate(tried, start=1):
        deadline = started + config.time_budget * number / len(tried)
        found = problem.search(length, seed, Watch(should_stop, deadline))
        ways = problem.candidates(found, Watch(should_stop, math.inf))
        candidates = list(itertools.islice(ways, count))
        best += [candidates] if candidates else []
        rated = rated or bool(found.costs.isfinite().any())
    if not best:
        raise _no_plan(config, tried, rated)
    elapsed = 1000.0 * (time.monotonic() - started)
    chosen = _fewest_steps(best, config.step_margin)
    return [problem.fold_plan(candidate, elapsed) for candidate in chosen]


def _no_plan(config: PlannerConfig, tried: list[int], rated: bool) -> NoPlanError:
    if not rated and math.isfinite(config.time_budget):
        return NoPlanError(
            f"the time budget of {config.time_budget:g} s was spent before any sequence of "
            f"{tried} steps had been rated; give more time, or fewer search.candidates"
        )
    return NoPlanError(
        f"none of {config.restarts} restarts for {tried} steps ended with a grasp on the "
        "cloth, within reach, in every step; is the goal what the initial state shows already? "
        "Otherwise try more restarts, fewer steps or another seed"
    )


def _fewest_steps(found: list[list[Candidate]], margin: float) -> list[Candidate]:
    """Take the shortest plans, the first of which costs within a margin of the best one."""
    limit = (1.0 + margin) * min(candidates[0].cost for candidates in found)
    return next(candidates for candidates in found if candidates[0].cost <= limit)


def _check(net: StatePredictor, initial: VoxelGrid, goal: VoxelGrid, steps: int) -> None:
    if steps < 0:
        raise InvalidInputError(f"steps must be 1 or more, or 0 to choose, got {steps}")
    if initial.field_of_view != goal.field_of_view:
        raise InvalidInputError(
            f"initial and goal state must cover one field of view, got {initial.field_of_view} "
            f"and {goal.field_of_view}; voxelise both alike"
        )
    if tuple(initial.occupancy.shape) != net.config.grid_size:
        raise InvalidInputError(
            f"the net takes grids of {net.config.grid_size}, got {initial.occupancy.shape}; "
            "voxelise with the net's field of view"
        )
    for name, grid in (("initial", initial), ("goal", goal)):
        if not grid.occupancy.any():
            raise InvalidInputError(f"the {name} state holds no cloth; look again")
