"""Random manipulations through the arms' planner, audited."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from emd_arm_executor.executor import MotionExecutor
from emd_arm_executor.mock_robot import MockRobot
from emd_arm_executor.motion_plan import MotionPlan, Phase
from emd_arm_executor.motion_planner import MotionPlanner
from emd_arm_executor.robot_description import hiro_description
from emd_arm_executor.robot_model import RobotModel
from emd_arm_executor.trajectory import TimedPath
from emd_cell.motion_check.audit import audit_motion
from emd_cell.motion_check.campaign import Campaign, check_task, run_campaign, summarise
from emd_cell.motion_check.random_tasks import random_task
from emd_core.errors import CancelledError, InvalidInputError

# The first task of two hands that HIRO carries out, the first in which its torso turns, and two in
# which something once went wrong.
TWO_HANDS, TURNED, KNOTS, GRAZE = 9, 2, 154, 483


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    """HIRO at its table."""
    return RobotModel(hiro_description())


@pytest.fixture(scope="module")
def plan(robot: RobotModel) -> MotionPlan:
    """A motion of both arms."""
    task = random_task(0, TWO_HANDS)
    rest = dict(robot.description.rest)
    return MotionPlanner(robot).plan_motion(task.manipulation, task.silhouette, rest)


def test_tasks_repeat_and_differ() -> None:
    """A seed and an index give the same task again, another index another one."""
    first, again, other = random_task(1, 5), random_task(1, 5), random_task(1, 6)
    points = [t.manipulation.grasp_points_in_table for t in (first, again, other)]
    assert np.array_equal(points[0], points[1], equal_nan=True)
    assert not np.array_equal(points[0], points[2], equal_nan=True)
    assert np.array_equal(first.silhouette.mask, again.silhouette.mask)


def test_grasp_points_lie_on_the_cloth() -> None:
    """Every point of 40 tasks lies in a cell of the mask, or next to one."""
    for index in range(40):
        task = random_task(2, index)
        cloth = task.silhouette
        for point in task.manipulation.grasp_points_in_table[list(task.manipulation.used)]:
            x, y = ((point - cloth.origin_in_table) / cloth.resolution).astype(int)
            assert cloth.mask[x - 1 : x + 2, y - 1 : y + 2].any()


def test_a_planned_motion_passes(robot: RobotModel, plan: MotionPlan) -> None:
    """Limits hold, nothing touches, hands keep to their paths and together."""
    audit = audit_motion(robot, plan, robot.description.rest)
    assert audit.passed, audit
    assert audit.checked > 500


def test_limits_hold_at_the_knots_too(robot: RobotModel) -> None:
    """A task whose jerk once stood out by 0.2 % between two instants that were checked."""
    task, rest = random_task(0, KNOTS), dict(robot.description.rest)
    plan = MotionPlanner(robot).plan_motion(task.manipulation, task.silhouette, rest)
    assert audit_motion(robot, plan, rest).jerk <= 1.0


def test_haste_is_noticed(robot: RobotModel, plan: MotionPlan) -> None:
    """The same motion in nine tenths of its time breaks the limits that it was planned for."""
    hasty = tuple(
        Phase(
            phase.name,
            tuple(TimedPath(s.path, s.profile.slowed(0.9)) for s in phase.segments),
            phase.gripper,
            phase.pause,
        )
        for phase in plan.phases
    )
    audit = audit_motion(robot, replace(plan, phases=hasty), robot.description.rest)
    assert not audit.passed
    assert audit.jerk > 1.1


def test_a_forgotten_segment_is_noticed(robot: RobotModel, plan: MotionPlan) -> None:
    """Without its way down to the hem the motion jumps."""
    first = replace(plan.phases[0], segments=plan.phases[0].segments[:-2])
    cut = replace(plan, phases=(first, *plan.phases[1:]))
    assert audit_motion(robot, cut, robot.description.rest).jump > 0.01


def test_a_table_that_is_higher_is_touched(robot: RobotModel, plan: MotionPlan) -> None:
    """Where the table stands 3 cm higher than planned for, the audit finds contacts."""
    description = hiro_description()
    higher = replace(
        description, table_centre_in_base=description.table_centre_in_base + [0.0, 0.0, 0.03]
    )
    audit = audit_motion(RobotModel(higher), plan, description.rest)
    assert any("table" in contact for contact in audit.contacts)


def test_the_torso_helps_where_the_arms_do_not_reach(robot: RobotModel) -> None:
    """A task that is refused with the torso at rest is carried out with it turned, and back."""
    task = random_task(0, TURNED)
    planner = MotionPlanner(robot)
    record = check_task(robot, planner, task, TURNED)
    assert record["torso"] and record["passed"] and record["moved"]
    config = replace(robot.config, grasp=replace(robot.config.grasp, torso_turns=()))
    record = check_task(robot, MotionPlanner(robot, config), task, TURNED)
    assert record["refused"] == "OutOfReachError" and not record["moved"]


def test_a_cancelled_motion_brings_the_torso_home(robot: RobotModel) -> None:
    """Stopped while it carries with the torso turned, the robot goes home, torso included."""
    task, rest = random_task(0, TURNED), dict(robot.description.rest)
    planner, mock = MotionPlanner(robot), MockRobot(dict(rest))
    executor = MotionExecutor(mock, robot)
    plan = planner.plan_motion(task.manipulation, task.silhouette, rest)
    before = sum(phase.duration for phase in plan.phases[:2])
    with pytest.raises(CancelledError):
        executor.run(plan, None, lambda: mock.now() >= before + 0.5)
    torso = robot.description.torso
    assert torso is not None
    assert abs(mock.joint_positions()[torso.joint_name] - rest[torso.joint_name]) > 0.2
    executor.run(planner.plan_home(mock.joint_positions(), open_hands=True))
    end = mock.joint_positions()
    names = (torso.joint_name, *robot.joint_names(tuple(robot.arms)))
    assert [end[name] for name in names] == pytest.approx([rest[n] for n in names], abs=1e-5)


def test_a_campaign_goes_on_where_it_ended(tmp_path: Path) -> None:
    """After an interruption it plans only the rest; a journal of other sources is refused."""
    robot, journal = hiro_description(), tmp_path / "journal.jsonl"
    whole = Campaign(3, 4, "same")
    run_campaign(robot, whole, journal, until=lambda: True)
    assert len(journal.read_text().splitlines()) == 2
    done: list[int] = []
    records = run_campaign(robot, whole, journal, done.append, workers=2)
    assert done == [2, 3] and [record["index"] for record in records] == [0, 1, 2]
    summary = summarise(records)
    assert summary["carried_out"] + summary["refused"] == 3 and summary["refused_and_moved"] == 0
    json.dumps(summary)
    with pytest.raises(InvalidInputError, match="another place"):
        run_campaign(robot, replace(whole, identity="changed"), journal)


def test_a_graze_is_refused_or_passed_by(robot: RobotModel) -> None:
    """A task whose elbow once passed through the chest by 0.3 mm between two checked postures."""
    record = check_task(robot, MotionPlanner(robot), random_task(0, GRAZE), GRAZE)
    assert "refused" in record or record["passed"], record
