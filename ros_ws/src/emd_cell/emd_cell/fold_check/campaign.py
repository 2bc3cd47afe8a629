"""Folds goal after goal with a running simulated cell."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from emd_arm_executor.motion_planner import MotionPlanner
from emd_cell.fold_check.random_goals import FoldGoal, fold_without_robot, random_goal
from emd_cell.ros.cell_client import CellClient
from emd_core.errors import CellError
from emd_core.independent_manipulation import HandsManipulation
from emd_core.metrics import voxel_mse

# Plans tried, each from another seed, when the arms cannot carry one out.
ATTEMPTS = 3
_GRASP = "grasp"
# Words of an error that are kept with its record.
_QUOTED = 300


def fold_goal(
    client: CellClient,
    planner: MotionPlanner,
    seed: int,
    index: int,
    on_phase: Callable[[str], None] = lambda text: None,
) -> dict[str, Any]:
    """Lay the cloth flat, look, plan one manipulation to a random goal, fold, and compare.

    Args:
        client: Of the simulated cell, which is ready.
        planner: Decides which goals the arms can reach.
        seed: Of goals and searches.
        index: Number of the goal.
        on_phase: Told what happens.

    Returns:
        A record for JSON: `grasps` (how often jaws closed), `grasped` (at the first try),
        `voxel_mse` of the truth and `voxel_mse_without_robot` of the same manipulation, `seconds`
        from the look to the arms at rest, `error` or None.
    """
    goal = random_goal(planner, seed, index)
    client.reset_simulation()
    record: dict[str, Any] = {
        "index": index,
        "hands": int(sum(goal.manipulation.used)),
        "goal": goal.manipulation.as_entry(),
        "idle_mse": goal.idle_mse,
        "refusals": [],
        "grasps": 0,
        "error": None,
    }
    began = time.perf_counter()
    try:
        executed = _fold(client, goal, seed, record, on_phase)
    except CellError as err:
        record["error"] = _quoted(err)
        client.go_home()
    else:
        record["seconds"] = time.perf_counter() - began
        record["executed"] = executed.as_entry()
        alone = fold_without_robot(executed)
        record["voxel_mse_without_robot"] = None if alone is None else voxel_mse(alone, goal.grid)
    record["voxel_mse"] = voxel_mse(client.true_grid(), goal.grid)
    record["grasped"] = record["error"] is None and record["grasps"] == 1
    return record


def _fold(
    client: CellClient,
    goal: FoldGoal,
    seed: int,
    record: dict[str, Any],
    on_phase: Callable[[str], None],
) -> HandsManipulation:
    """Plan and carry out; plans that the arms refuse are followed by others."""
    on_phase("looking")
    seen = client.capture().grid
    phases: list[str] = []

    def follow(phase: str, progress: float) -> None:
        """Count how often jaws begin to close."""
        on_phase(f"{phase} {progress:.0%}")
        if phase == _GRASP and (not phases or phases[-1] != _GRASP):
            record["grasps"] += 1
        phases.append(phase)

    for attempt in range(ATTEMPTS):
        on_phase("planning")
        plan = client.plan(seen, goal.grid, 1, seed + attempt)
        record.update(plan_ms=plan.planning_ms, expected_error=plan.expected_error)
        try:
            return client.execute(plan.manipulations[0], follow)
        except CellError as err:
            if phases or attempt == ATTEMPTS - 1:
                raise
            record["refusals"].append(_quoted(err))
    raise AssertionError("the last attempt returns or raises")


def _quoted(err: CellError) -> str:
    return f"{type(err).__name__}: {err}"[:_QUOTED]
