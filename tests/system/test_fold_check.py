"""A random goal through all nodes, and the same manipulation without a robot."""

from __future__ import annotations

import pytest

from emd_arm_executor.motion_planner import MotionPlanner
from emd_arm_executor.robot_description import hiro_description
from emd_arm_executor.robot_model import RobotModel
from emd_cell.fold_check.campaign import fold_goal
from emd_cell.fold_check.summary import summarise

pytestmark = pytest.mark.system


def test_a_random_goal_is_folded_and_compared(client) -> None:
    """The cloth comes nearer to the goal, grasped once, about as near as without a robot."""
    told: list[str] = []
    planner = MotionPlanner(RobotModel(hiro_description()))
    record = fold_goal(client, planner, 0, 0, told.append)
    assert record["error"] is None and record["grasped"]
    assert record["voxel_mse"] < 0.5 * record["idle_mse"]
    assert record["voxel_mse"] == pytest.approx(record["voxel_mse_without_robot"], abs=0.003)
    assert told[:2] == ["looking", "planning"] and any("carry" in text for text in told)
    assert summarise([record])["folded"] == 1
