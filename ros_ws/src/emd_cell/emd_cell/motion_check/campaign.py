"""Plans random tasks, carries them out and audits them, on all cores, and can go on later."""

from __future__ import annotations

import multiprocessing
import time
from collections import Counter
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from emd_arm_executor.executor import MotionExecutor
from emd_arm_executor.mock_robot import MockRobot
from emd_arm_executor.motion_plan import MotionPlan
from emd_arm_executor.motion_planner import MotionPlanner
from emd_arm_executor.robot_description import RobotDescription
from emd_arm_executor.robot_model import RobotModel
from emd_cell.journal import Journal
from emd_cell.motion_check.audit import audit_motion
from emd_cell.motion_check.random_tasks import MotionTask, random_task
from emd_core.errors import CellError

# Every so many plans one is planned twice and compared bit by bit.
_REPEAT = 10
# Words of a refusal that are kept with its record.
_QUOTED = 300


@dataclass(frozen=True)
class Campaign:
    """Which tasks are planned.

    Attributes:
        count: How many.
        seed: Of the tasks.
        identity: Digest of the sources that plan, so that a journal is not gone on with by others.
    """

    count: int
    seed: int
    identity: str


def run_campaign(
    description: RobotDescription,
    campaign: Campaign,
    journal: Path,
    on_progress: Callable[[int], None] | None = None,
    until: Callable[[], bool] | None = None,
    workers: int = 1,
) -> list[dict[str, Any]]:
    """Plan, carry out and audit tasks; go on where the journal ends.

    Args:
        description: The robot.
        campaign: Which tasks.
        journal: One JSON line for the campaign, then one for each task.
        on_progress: Called with the number of tasks done.
        until: Asked after each task; True ends the run early, the journal stays.
        workers: Processes, one core each; the records are the same and in the same order.

    Returns:
        The records of all tasks done so far.

    Raises:
        InvalidInputError: If the journal is another campaign's.
    """
    kept = Journal(journal, {"seed": campaign.seed, "identity": campaign.identity})
    indices = range(len(kept.records), campaign.count)
    with closing(_check_all(description, campaign.seed, indices, workers)) as records:
        for record in records:
            kept.append(record)
            if on_progress is not None:
                on_progress(len(kept.records))
            if until is not None and until():
                break
    return kept.records[: campaign.count]


def _check_all(
    description: RobotDescription, seed: int, indices: range, workers: int
) -> Generator[dict[str, Any]]:
    if workers == 1:
        yield from map(_Checker(description, seed), indices)
        return
    start = partial(_start, description, seed)
    with multiprocessing.get_context("spawn").Pool(workers, start) as pool:
        yield from pool.imap(_check, indices)


class _Checker:
    """Checks tasks by their indices."""

    def __init__(self, description: RobotDescription, seed: int) -> None:
        self._robot = RobotModel(description)
        self._planner = MotionPlanner(self._robot)
        self._seed = seed

    def __call__(self, index: int) -> dict[str, Any]:
        return check_task(self._robot, self._planner, random_task(self._seed, index), index)


_checker: _Checker


def _start(description: RobotDescription, seed: int) -> None:
    """Make the checker of a worker process."""
    global _checker
    _checker = _Checker(description, seed)


def _check(index: int) -> dict[str, Any]:
    return _checker(index)


def check_task(
    robot: RobotModel, planner: MotionPlanner, task: MotionTask, index: int
) -> dict[str, Any]:
    """Plan one task; carry it out and audit it, or keep the reason of its refusal."""
    rest = dict(robot.description.rest)
    record: dict[str, Any] = {
        "index": index,
        "kind": task.kind,
        "hands": int(sum(task.manipulation.used)),
    }
    began, worked = time.perf_counter(), time.process_time()
    plan, refusal = _attempt(planner, task, rest)
    record["plan_ms"] = 1e3 * (time.perf_counter() - began)
    record["plan_cpu_ms"] = 1e3 * (time.process_time() - worked)
    mock = MockRobot(dict(rest))
    if plan is None:
        record.update(refused=type(refusal).__name__, reason=str(refusal)[:_QUOTED])
    else:
        MotionExecutor(mock, robot).run(plan)
        audit = audit_motion(robot, plan, rest)
        torso = robot.description.torso
        names = {name for sent in mock.sent for name in sent.trajectory.joint_names}
        record.update(
            audit.as_entry(),
            passed=audit.passed,
            duration=plan.duration,
            torso=torso is not None and torso.joint_name in names,
        )
    record["moved"] = bool(mock.sent)
    if index % _REPEAT == 0:
        record["identical"] = _same(plan, _attempt(planner, task, rest)[0])
    return record


def summarise(records: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Count what became of the tasks and give the worst of those carried out."""
    planned = [record for record in records if "passed" in record]
    refused = [record for record in records if "refused" in record]
    repeated = [record for record in records if "identical" in record]
    worst = ("velocity", "acceleration", "jerk", "deviation_mm", "deviation_deg", "apart_mm")
    return {
        "tasks": len(records),
        "carried_out": len(planned),
        "carried_out_two_hands": sum(record["hands"] == 2 for record in planned),
        "torso_turned": sum(record["torso"] for record in planned),
        "failed_audit": sum(not record["passed"] for record in planned),
        "with_contact": sum(bool(record["contacts"]) for record in planned),
        "refused": len(refused),
        "refused_by": dict(Counter(record["refused"] for record in refused)),
        "refused_without_reason": sum(not record["reason"] for record in refused),
        "refused_and_moved": sum(record["moved"] for record in refused),
        "neither": len(records) - len(planned) - len(refused),
        "planned_twice": len(repeated),
        "not_identical": sum(not record["identical"] for record in repeated),
        "configurations_checked": sum(record["checked"] for record in planned),
        "worst": {key: max((record[key] for record in planned), default=None) for key in worst},
        "least_clearance_mm": min((record["clearance_mm"] for record in planned), default=None),
        "worst_position": max((record["position"] for record in planned), default=None),
        "plan_cpu_ms_p50": _median([record["plan_cpu_ms"] for record in planned]),
        "refuse_cpu_ms_p50": _median([record["plan_cpu_ms"] for record in refused]),
    }


def _median(values: Sequence[float]) -> float | None:
    return float(np.median(values)) if values else None


def _attempt(
    planner: MotionPlanner, task: MotionTask, rest: dict[str, float]
) -> tuple[MotionPlan | None, CellError | None]:
    try:
        return planner.plan_motion(task.manipulation, task.silhouette, rest), None
    except CellError as err:
        return None, err


def _same(first: MotionPlan | None, second: MotionPlan | None) -> bool:
    """Whether two plans are equal to the bit, or both are refused."""
    if first is None or second is None:
        return first is None and second is None
    pairs = zip(_numbers(first), _numbers(second), strict=False)
    same_length = len(_numbers(first)) == len(_numbers(second))
    return same_length and all(np.array_equal(a, b) for a, b in pairs)


def _numbers(plan: MotionPlan) -> list[np.ndarray]:
    trajectories = [t for phase in plan.phases for t in phase.trajectories(0.02)]
    return [array for t in trajectories for array in (t.times, t.positions, t.velocities)]
