"""Random reachable goals and the count of what became of them."""

from __future__ import annotations

import numpy as np
import pytest

from emd_arm_executor.motion_planner import MotionPlanner
from emd_arm_executor.robot_description import hiro_description
from emd_arm_executor.robot_model import RobotModel
from emd_cell.fold_check.random_goals import fold_without_robot, random_goal
from emd_cell.fold_check.summary import summarise
from emd_core.metrics import voxel_mse


@pytest.fixture(scope="module")
def planner() -> MotionPlanner:
    """Of HIRO's arms."""
    return MotionPlanner(RobotModel(hiro_description()))


def test_goals_repeat_differ_and_are_what_their_manipulation_makes(planner: MotionPlanner) -> None:
    """A seed and an index give one goal; folding the flat cloth that way reaches it."""
    goal, again, other = (random_goal(planner, 7, index) for index in (0, 0, 1))
    assert np.array_equal(goal.grid.occupancy, again.grid.occupancy)
    assert not np.array_equal(goal.grid.occupancy, other.grid.occupancy)
    made = fold_without_robot(goal.manipulation)
    assert made is not None and voxel_mse(made, goal.grid) == 0.0
    assert goal.idle_mse >= 0.01


def _record(**values: object) -> dict[str, object]:
    folded = {
        "index": 0,
        "idle_mse": 0.03,
        "refusals": [],
        "grasps": 1,
        "grasped": True,
        "error": None,
        "seconds": 30.0,
        "plan_ms": 400.0,
        "voxel_mse": 0.011,
        "voxel_mse_without_robot": 0.010,
    }
    return {key: value for key, value in {**folded, **values}.items() if value != "absent"}


def test_grasps_and_errors_are_counted() -> None:
    """A second try counts as no success, a refusal neither way, means run over folded cloth."""
    records = [
        _record(),
        _record(grasps=2, grasped=False, seconds=60.0, voxel_mse=0.013),
        _record(
            grasps=0,
            grasped=False,
            error="NoPlanError: none",
            seconds="absent",
            plan_ms="absent",
            voxel_mse_without_robot="absent",
        ),
    ]
    summary = summarise(records)
    assert (summary["goals"], summary["grasps_tried"], summary["grasped_at_once"]) == (3, 2, 1)
    assert summary["grasp_success"] == 0.5
    assert summary["folded"] == 2 and summary["not_folded"] == ["NoPlanError: none"]
    assert summary["robot_over_without"] == pytest.approx(1.2)
    assert summary["folds_an_hour"] == pytest.approx(80.0)


def test_nothing_done_is_said_as_nothing() -> None:
    """Without a record no share is made up."""
    summary = summarise([])
    assert summary["goals"] == 0
    assert summary["grasp_success"] is summary["robot_over_without"] is None
