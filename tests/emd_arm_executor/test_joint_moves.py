"""Moves through free space."""

from __future__ import annotations

import numpy as np
import pytest

from emd_arm_executor.joint_moves import JointMove, plan_joint_move, raise_hands
from emd_arm_executor.joint_path import JointPath
from emd_arm_executor.robot_model import RobotModel
from emd_core.errors import CollisionError
from emd_core.frames import FloatArray, inverse_transform

BOTH = ("left", "right")


def _at(robot: RobotModel, arm: str, x: float, y: float, z: float) -> FloatArray:
    vertical = np.diag([1.0, -1.0, -1.0, 1.0])
    vertical[:3, 3] = [x, y, z]
    target = robot.transform_table_to_base @ vertical
    return robot.arms[arm].solve(target, robot.rest_positions([arm]))


def _move(robot: RobotModel, start: FloatArray, goal: FloatArray, arms=BOTH) -> JointMove:
    return JointMove("test", arms, start, goal, dict(robot.description.rest), {})


def _is_joined(paths: list[JointPath], start: FloatArray, goal: FloatArray) -> bool:
    ends = [start, *(path.positions(path.length) for path in paths)]
    begins = [path.positions(0.0) for path in paths]
    joined = all(np.allclose(a, b, atol=1e-5) for a, b in zip(ends, begins, strict=False))
    return joined and np.allclose(ends[-1], goal, atol=1e-5)


def test_free_way_is_straight(robot: RobotModel) -> None:
    """From rest to above the cloth both arms go straight at once."""
    goal = np.concatenate(
        [_at(robot, "left", -0.1, -0.15, 0.08), _at(robot, "right", -0.1, 0.15, 0.08)]
    )
    start = robot.rest_positions(BOTH)
    (path,) = plan_joint_move(robot, _move(robot, start, goal))
    middle = path.positions(path.length / 2)
    assert middle == pytest.approx((start + goal) / 2)


def test_nothing_to_move_is_no_path(robot: RobotModel) -> None:
    """Arms that are there already stay."""
    rest = robot.rest_positions(BOTH)
    assert plan_joint_move(robot, _move(robot, rest, rest.copy())) == []


def test_blocked_way_is_gone_round(robot: RobotModel) -> None:
    """Hands that would meet on the straight way take turns or rise, and touch nothing."""
    start = np.concatenate(
        [_at(robot, "left", 0.08, -0.07, 0.02), _at(robot, "right", -0.05, 0.07, 0.02)]
    )
    goal = np.concatenate(
        [_at(robot, "left", -0.05, -0.07, 0.02), _at(robot, "right", 0.08, 0.07, 0.02)]
    )
    move = _move(robot, start, goal)
    paths = plan_joint_move(robot, move)
    assert _is_joined(paths, start, goal)
    names = robot.joint_names(BOTH)
    for path in paths:
        _, positions = path.densely(0.02)
        rows = robot.configurations(move.others, names, positions, {})
        assert all(robot.collision.contact(q) is None for q in rows)


def test_impossible_goal_is_refused(robot: RobotModel) -> None:
    """A goal inside the table is refused with what it would touch."""
    goal = _at(robot, "left", 0.0, -0.15, -0.03)
    move = _move(robot, robot.rest_positions(["left"]), goal, ("left",))
    with pytest.raises(CollisionError, match="table"):
        plan_joint_move(robot, move)


def test_start_in_contact_may_be_left(robot: RobotModel) -> None:
    """An arm that touches the table at the start can still go home."""
    start = _at(robot, "left", 0.0, -0.15, -0.008)
    move = _move(robot, start, robot.rest_positions(["left"]), ("left",))
    assert plan_joint_move(robot, move)


def test_raising_goes_straight_up(robot: RobotModel) -> None:
    """A low hand is lifted without moving sideways; a high one stays."""
    low = np.concatenate(
        [_at(robot, "left", 0.0, -0.15, 0.01), _at(robot, "right", 0.0, 0.15, 0.12)]
    )
    path = raise_hands(robot, BOTH, low, 0.1)
    assert path is not None
    to_table = inverse_transform(robot.transform_table_to_base)
    for parameter in np.linspace(0.0, path.length, 15):
        positions = path.positions(parameter)
        left = to_table @ robot.arms["left"].forward(positions[:6])
        right = to_table @ robot.arms["right"].forward(positions[6:])
        assert left[:2, 3] == pytest.approx([0.0, -0.15], abs=5e-4)
        assert right[:3, 3] == pytest.approx([0.0, 0.15, 0.12], abs=5e-4)
    assert left[2, 3] == pytest.approx(0.1, abs=1e-4)


def test_hands_that_are_high_need_no_raising(robot: RobotModel) -> None:
    """Nothing is planned for hands above the height."""
    high = _at(robot, "left", 0.0, -0.15, 0.12)
    assert raise_hands(robot, ("left",), high, 0.1) is None
