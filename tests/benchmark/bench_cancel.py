"""Motions cancelled at random moments: how soon the arms stand, and whether they go home then.

The robot obeys perfectly in virtual time and is looked at as often as the executor looks. Moments
are spread evenly over four motions of `./cell check-motion`, two of them with both hands. The time
until the arms stand counts from the request, the wait for the next look included.
"""

from __future__ import annotations

import numpy as np
from rich.console import Console
from rich.progress import track

from emd_arm_executor.executor import MotionExecutor
from emd_arm_executor.mock_robot import MockRobot, SentTrajectory
from emd_arm_executor.motion_limits import MotionLimits
from emd_arm_executor.motion_plan import MotionPlan
from emd_arm_executor.motion_planner import MotionPlanner
from emd_arm_executor.robot_description import hiro_description
from emd_arm_executor.robot_model import RobotModel
from emd_cell.bench import BenchmarkResult
from emd_cell.motion_check.random_tasks import random_task
from emd_core.errors import CancelledError, CellError

MOMENTS = 200
MOTIONS = 4
SEED = 5


def run() -> BenchmarkResult:
    """Cancel, measure, go home."""
    robot = RobotModel(hiro_description())
    planner = MotionPlanner(robot)
    plans = _plans(planner)
    rng = np.random.default_rng(SEED)
    rows = [
        _cancel(robot, planner, plans[k % MOTIONS], float(share))
        for k, share in enumerate(
            track(rng.uniform(0.0, 1.0, MOMENTS), "moments", console=Console(stderr=True))
        )
    ]
    times = [row["stands_after"] for row in rows]
    summary = {
        "moments": len(rows),
        "stands_after_max_s": max(times),
        "stands_after_p50_s": float(np.median(times)),
        "within_0.4_s": sum(time <= 0.4 for time in times),
        "limits_kept": sum(max(row["excess"]) <= 1.01 for row in rows),
        "home_afterwards": sum(row["home"] for row in rows),
    }
    return BenchmarkResult({"seed": SEED, "motions": MOTIONS}, rows, summary)


def _plans(planner: MotionPlanner) -> list[MotionPlan]:
    """Plan the first tasks that can be carried out, as many with one hand as with two."""
    rest = dict(planner.robot.description.rest)
    plans: dict[int, list[MotionPlan]] = {1: [], 2: []}
    index = 0
    while min(len(group) for group in plans.values()) < MOTIONS // 2:
        task = random_task(SEED, index)
        index += 1
        group = plans[int(sum(task.manipulation.used))]
        if len(group) < MOTIONS // 2:
            try:
                group.append(planner.plan_motion(task.manipulation, task.silhouette, rest))
            except CellError:
                continue
    return plans[1] + plans[2]


def _cancel(robot: RobotModel, planner: MotionPlanner, plan: MotionPlan, share: float) -> dict:
    mock = MockRobot(dict(robot.description.rest))
    executor, moment = MotionExecutor(mock, robot), share * plan.duration
    asked: list[float] = []

    def stop() -> bool:
        if mock.now() >= moment:
            asked.append(mock.now())
        return bool(asked)

    try:
        executor.run(plan, None, stop)
    except CancelledError:
        pass
    stopping = [sent for sent in mock.sent if asked and sent.start_time >= asked[0]]
    ends = [sent.start_time + sent.trajectory.duration for sent in stopping]
    excess = np.max([_excess(robot, sent) for sent in stopping] or [(0.0, 0.0, 0.0)], axis=0)
    reason = ""
    try:
        executor.run(planner.plan_home(mock.joint_positions(), open_hands=True))
    except CellError as err:
        reason = str(err)
    arms = tuple(robot.arms)
    gap = robot.arm_positions(arms, mock.joint_positions()) - robot.rest_positions(arms)
    return {
        "moment": moment,
        "stands_after": max([*ends, *asked[:1]], default=moment) - moment,
        "excess": excess.tolist(),
        "home": bool(np.abs(gap).max() < 1e-5),
        "reason": reason,
    }


def _excess(robot: RobotModel, sent: SentTrajectory) -> tuple[float, float, float]:
    """Ratios of velocity, acceleration and jerk to the limits for stopping, as sampled."""
    trajectory = sent.trajectory
    limits = MotionLimits.for_stop(robot.max_velocity(trajectory.joint_names), robot.config.timing)
    steps = np.diff(trajectory.times)[:, None]
    jerks = np.diff(trajectory.accelerations, axis=0) / steps
    return limits.excess(trajectory.velocities, trajectory.accelerations, jerks)
