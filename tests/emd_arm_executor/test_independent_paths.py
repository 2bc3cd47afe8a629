"""Two hands that go ways of their own."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from emd_arm_executor.config import PathConfig
from emd_arm_executor.executor import MotionExecutor
from emd_arm_executor.mock_robot import MockRobot
from emd_arm_executor.motion_plan import MotionPlan, PhaseName
from emd_arm_executor.motion_planner import MotionPlanner
from emd_arm_executor.robot_model import RobotModel
from emd_arm_executor.silhouette import Silhouette
from emd_core.errors import CollisionError, InvalidInputError
from emd_core.independent_manipulation import IndependentManipulation
from emd_core.manipulation import Manipulation

POINTS = np.array([[-0.2, -0.2], [-0.2, 0.2]])
WAYS = np.array([[0.30, 0.10], [0.15, -0.04]])
Towel = Callable[..., Silhouette]


@pytest.fixture(scope="module")
def apart(planner: MotionPlanner, robot: RobotModel, towel: Towel) -> MotionPlan:
    """The far corners brought inwards, one twice as far as the other."""
    manipulation = IndependentManipulation(POINTS, WAYS)
    return planner.plan_motion(manipulation, towel(), dict(robot.description.rest))


def test_each_hand_goes_its_own_way(apart: MotionPlan, robot: RobotModel) -> None:
    """A hand's displacement is its own, shortened only for where it grips."""
    assert len(apart.grasps) == 2
    for arm, grasp in apart.grasps.items():
        row = int(np.argmin(np.linalg.norm(POINTS - grasp.hem.point_in_table, axis=1)))
        moved = apart.displacements_in_table[arm]
        carried = apart.via_poses_in_table[arm][:, :3, 3]
        assert carried[-1, :2] - carried[0, :2] == pytest.approx(moved, abs=1e-9)
        along = WAYS[row] / np.linalg.norm(WAYS[row])
        assert moved == pytest.approx(along * np.linalg.norm(moved), abs=1e-9)
        assert 0.0 < np.linalg.norm(WAYS[row]) - np.linalg.norm(moved) < 0.05
        assert carried[:, 2].max() == pytest.approx(robot.config.path.lift_height, abs=1e-6)


def test_both_set_out_and_arrive_together(apart: MotionPlan) -> None:
    """The paths have equally many via-poses, along which both hands move evenly."""
    (carry,) = next(phase.segments for phase in apart.phases if phase.name is PhaseName.CARRY)
    assert len(carry.path.joint_names) == 12
    steps = [np.linalg.norm(np.diff(p[:, :3, 3], axis=0), axis=1) for p in _poses(apart)]
    assert len(steps[0]) == len(steps[1])
    assert max(step.max() for step in steps) <= PathConfig().linear_step + 1e-9
    for step in steps:
        assert step.max() < 1.1 * step.min()
    lengths = sorted(step.sum() for step in steps)
    assert lengths[0] < 0.7 * lengths[1]


def test_equal_displacements_are_one(
    planner: MotionPlanner, robot: RobotModel, towel: Towel
) -> None:
    """Hands that are told the same make the same motion, to the bit, as hands that share it."""
    way, rest = np.array([0.25, 0.0]), dict(robot.description.rest)
    own = planner.plan_motion(IndependentManipulation(POINTS, np.stack([way] * 2)), towel(), rest)
    shared = planner.plan_motion(Manipulation(POINTS, way), towel(), rest)
    for one, other in zip(own.phases, shared.phases, strict=True):
        for left, right in zip(one.segments, other.segments, strict=True):
            assert np.array_equal(left.sample(0.02).positions, right.sample(0.02).positions)


def test_a_robot_carries_it_out(apart: MotionPlan, robot: RobotModel, mock: MockRobot) -> None:
    """Both arms follow and end at rest."""
    MotionExecutor(mock, robot).run(apart)
    end = robot.arm_positions(("left", "right"), mock.joint_positions())
    assert end == pytest.approx(robot.rest_positions(("left", "right")), abs=1e-5)


def test_hands_that_would_meet_are_refused(
    planner: MotionPlanner, robot: RobotModel, towel: Towel
) -> None:
    """Ways that lead both hands to one place collide, however far apart they begin."""
    meeting = IndependentManipulation(POINTS, np.array([[0.2, 0.2], [0.2, -0.2]]))
    with pytest.raises(CollisionError):
        planner.plan_motion(meeting, towel(), dict(robot.description.rest))


def test_a_hand_that_hardly_moves_is_refused(
    planner: MotionPlanner, robot: RobotModel, towel: Towel
) -> None:
    """Each displacement must be worth carrying out, not only the longer."""
    still = IndependentManipulation(POINTS, np.array([[0.2, 0.0], [0.0, 0.001]]))
    with pytest.raises(InvalidInputError, match="displacement of at least"):
        planner.plan_motion(still, towel(), dict(robot.description.rest))


def _poses(plan: MotionPlan) -> list[np.ndarray]:
    return [plan.via_poses_in_table[arm] for arm in plan.grasps]
