"""A robot model, its planner and cloths for the tests of the executor's core."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from emd_arm_executor.mock_robot import MockRobot
from emd_arm_executor.motion_plan import MotionPlan
from emd_arm_executor.motion_planner import MotionPlanner
from emd_arm_executor.robot_description import hiro_description
from emd_arm_executor.robot_model import RobotModel
from emd_arm_executor.silhouette import Silhouette
from emd_core.frames import FloatArray
from emd_core.manipulation import Manipulation

SIDE = 0.40
UNUSED = [np.nan, np.nan]


@pytest.fixture(scope="session")
def towel() -> Callable[..., Silhouette]:
    """Makes fine masks of a square cloth in the middle of the table, turned by an angle."""

    def make(angle: float = 0.0, side: float = SIDE, cell: float = 0.002) -> Silhouette:
        reach = 0.36
        axis = np.arange(-reach + cell / 2, reach, cell)
        x, y = np.meshgrid(axis, axis, indexing="ij")
        along = np.cos(angle) * x + np.sin(angle) * y
        across = -np.sin(angle) * x + np.cos(angle) * y
        mask = (np.abs(along) < side / 2) & (np.abs(across) < side / 2)
        return Silhouette(mask, np.array([cell, cell]), np.array([-reach, -reach]))

    return make


@pytest.fixture(scope="session")
def task() -> Callable[..., Manipulation]:
    """Makes manipulations from plain lists; one point means one hand."""

    def make(points: list[list[float]], displacement: list[float]) -> Manipulation:
        rows = points if len(points) == 2 else [*points, UNUSED]
        return Manipulation(np.array(rows), np.array(displacement))

    return make


@pytest.fixture(scope="session")
def robot() -> RobotModel:
    """HIRO at its table."""
    return RobotModel(hiro_description())


@pytest.fixture(scope="session")
def planner(robot: RobotModel) -> MotionPlanner:
    """A planner with the default configuration."""
    return MotionPlanner(robot)


@pytest.fixture(scope="session")
def half_fold(
    planner: MotionPlanner,
    robot: RobotModel,
    towel: Callable[..., Silhouette],
    task: Callable[..., Manipulation],
) -> MotionPlan:
    """Both far corners brought over the near ones."""
    fold = task([[-0.2, -0.2], [-0.2, 0.2]], [0.4, 0.0])
    return planner.plan_motion(fold, towel(), dict(robot.description.rest))


@pytest.fixture()
def mock(robot: RobotModel) -> MockRobot:
    """A perfect robot at rest."""
    return MockRobot(dict(robot.description.rest))


@pytest.fixture(scope="session")
def reachable_postures(robot: RobotModel) -> FloatArray:
    """Random postures of the left arm within its limits, shape (200, 6)."""
    arm = robot.arms["left"]
    return np.random.default_rng(7).uniform(arm.lower, arm.upper, (200, len(arm.lower)))
