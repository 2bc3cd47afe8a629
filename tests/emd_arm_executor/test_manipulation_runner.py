"""Manipulations with a second try, on a robot that obeys perfectly."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from emd_arm_executor.executor import MotionExecutor
from emd_arm_executor.manipulation_runner import ManipulationRunner, RunCallbacks
from emd_arm_executor.mock_robot import MockRobot
from emd_arm_executor.motion_plan import MotionPlan
from emd_arm_executor.motion_planner import MotionPlanner
from emd_arm_executor.robot_model import RobotModel
from emd_arm_executor.silhouette import Silhouette
from emd_core.errors import GraspFailedError
from emd_core.manipulation import Manipulation


class EmptyJaws(MockRobot):
    """The first few times that jaws close, there is nothing between them."""

    misses = 1

    def send_gripper(self, arm: str, width: float) -> None:
        """Close on nothing while misses are left."""
        if width == 0.0:
            self.holding_width = 0.0 if self.misses > 0 else 0.002
            self.misses -= 1
        super().send_gripper(arm, width)


@pytest.fixture()
def jaws(robot: RobotModel) -> EmptyJaws:
    """A robot at rest whose first grasp misses."""
    return EmptyJaws(dict(robot.description.rest))


@pytest.fixture()
def runner(planner: MotionPlanner, robot: RobotModel, jaws: EmptyJaws) -> ManipulationRunner:
    """Carries manipulations out with that robot."""
    return ManipulationRunner(planner, MotionExecutor(jaws, robot))


def test_a_missed_hem_is_left_for_another(
    runner: ManipulationRunner,
    jaws: EmptyJaws,
    robot: RobotModel,
    towel: Callable[..., Silhouette],
    task: Callable[..., Manipulation],
) -> None:
    """After a miss the hand grasps another hem, more than 2 cm away, and ends at rest."""
    plans: list[MotionPlan] = []
    corner = task([[0.16, -0.16]], [-0.1, 0.1])
    done = runner.run(corner, towel(), RunCallbacks(on_plan=plans.append))
    assert len(plans) == 2 and done is plans[1]
    (first,), (second,) = (plan.grasps.values() for plan in plans)
    assert np.linalg.norm(first.hem.point_in_table - second.hem.point_in_table) > 0.02
    end = robot.arm_positions(("left", "right"), jaws.joint_positions())
    assert end == pytest.approx(robot.rest_positions(("left", "right")), abs=1e-5)


def test_a_second_miss_is_reported_from_home(
    runner: ManipulationRunner,
    jaws: EmptyJaws,
    robot: RobotModel,
    towel: Callable[..., Silhouette],
    task: Callable[..., Manipulation],
) -> None:
    """Two misses end the manipulation with both arms home and the jaws open."""
    jaws.misses = 2
    with pytest.raises(GraspFailedError, match="second try, both arms are home"):
        runner.run(task([[0.16, -0.16]], [-0.1, 0.1]), towel())
    end = robot.arm_positions(("left", "right"), jaws.joint_positions())
    assert end == pytest.approx(robot.rest_positions(("left", "right")), abs=1e-5)
    assert all(jaws.gripper_width(arm) > 0.01 for arm in robot.arms)
