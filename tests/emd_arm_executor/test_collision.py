"""Collisions of arms with the table, the body and each other."""

from __future__ import annotations

import numpy as np
import pytest

from emd_arm_executor.collision import TABLE, Contact
from emd_arm_executor.joint_path import JointPath
from emd_arm_executor.robot_model import RobotModel
from emd_core.errors import CollisionError
from emd_core.frames import FloatArray


def _hand_at(robot: RobotModel, arm: str, x: float, y: float, z: float) -> FloatArray:
    """Joints of an arm with its hand vertical at a point of the table frame."""
    vertical = np.array(
        [[1.0, 0.0, 0.0, x], [0.0, -1.0, 0.0, y], [0.0, 0.0, -1.0, z], [0.0, 0.0, 0.0, 1.0]]
    )
    target = robot.transform_table_to_base @ vertical
    return robot.arms[arm].solve(target, robot.rest_positions([arm]))


def _configuration(robot: RobotModel, **arms: FloatArray) -> FloatArray:
    names = robot.joint_names(list(arms))
    widths = dict.fromkeys(arms, 0.0)
    positions = np.concatenate(list(arms.values()))[None]
    return robot.configurations({}, names, positions, widths)[0]


def test_rest_touches_nothing(robot: RobotModel) -> None:
    """The posture in which the arms wait is free."""
    rest = robot.rest_positions(["left", "right"])
    assert robot.collision.contact(_configuration(robot, left=rest[:6], right=rest[6:])) is None


def test_nails_may_touch_the_table_but_not_sink_into_it(robot: RobotModel) -> None:
    """A gripping hand is free 1 mm above the table and caught 10 mm below its surface."""
    free = _configuration(robot, left=_hand_at(robot, "left", 0.0, -0.15, 0.001))
    sunk = _configuration(robot, left=_hand_at(robot, "left", 0.0, -0.15, -0.010))
    assert robot.collision.contact(free) is None
    found = robot.collision.contacts(sunk)
    assert {"table", "LHAND_JOINT1_nail"} in [{c.first, c.second} for c in found]


def test_hands_at_one_place_collide(robot: RobotModel) -> None:
    """Both hands over the same point touch; 0.25 m apart they do not."""
    left = _hand_at(robot, "left", 0.0, -0.02, 0.05)
    right = _hand_at(robot, "right", 0.0, 0.02, 0.05)
    found = robot.collision.contacts(_configuration(robot, left=left, right=right))
    sides = [{c.first[0], c.second[0]} for c in found]
    assert {"L", "R"} in sides
    apart = _configuration(
        robot,
        left=_hand_at(robot, "left", 0.0, -0.125, 0.05),
        right=_hand_at(robot, "right", 0.0, 0.125, 0.05),
    )
    assert robot.collision.contact(apart) is None


def test_pairs_are_symmetric_and_keep_what_matters(robot: RobotModel) -> None:
    """Arm against arm, hand against body and hand against table are always checked."""
    pairs = [{c.first, c.second} for c in robot.collision.pairs]
    for side, other in (("L", "R"), ("R", "L")):
        assert {f"{side}ARM_JOINT4_Link", f"{other}ARM_JOINT4_Link"} in pairs
        assert {f"{side}HAND_JOINT1_Link", "CHEST_JOINT0_Link"} in pairs
        assert {f"{side}ARM_JOINT3_Link", "HEAD_JOINT1_Link"} in pairs
        assert {f"{side}ARM_JOINT5_Link", TABLE} in pairs
        assert {f"{side}ARM_JOINT1_Link", f"{side}ARM_JOINT2_Link"} not in pairs
        assert {f"{side}HAND_JOINT1_Link", f"{side}HAND_JOINT3_Link"} not in pairs


def test_pairs_are_chosen_the_same_way_every_time(robot: RobotModel) -> None:
    """Two checkers built alike check the same pairs."""
    again = RobotModel(robot.description)
    assert again.collision.pairs == robot.collision.pairs


def test_path_names_links_and_place(robot: RobotModel) -> None:
    """A path that dips into the table half-way says which links meet, and where."""
    high = _hand_at(robot, "left", 0.0, -0.15, 0.05)
    low = _hand_at(robot, "left", 0.0, -0.15, -0.03)
    positions = np.concatenate([np.linspace(high, low, 20), np.linspace(low, high, 20)])
    rows = robot.configurations({}, robot.joint_names(["left"]), positions, {"left": 0.0})
    with pytest.raises(CollisionError, match=r"'dip'.*nail and table meet at (2|3|4)\d%"):
        robot.collision.check_path(rows, "dip")


def test_ignored_contacts_may_go_on(robot: RobotModel) -> None:
    """What is ignored does not count as a meeting; anything else still does."""
    low = _hand_at(robot, "left", 0.0, -0.15, -0.010)
    rows = np.stack([_configuration(robot, left=low)])
    contacts = robot.collision.contacts(rows[0])
    assert robot.collision.meeting(rows, contacts) is None
    meeting = robot.collision.meeting(rows, [Contact("a", "b")])
    assert meeting is not None and meeting.contact in contacts
    assert robot.collision.arms_in(meeting.contact) == {"left"}


def test_a_path_with_nothing_left_to_check_is_free(robot: RobotModel) -> None:
    """Where every pair may touch, hands may sink into the table."""
    up, down = (
        _configuration(robot, left=_hand_at(robot, "left", 0.0, -0.1, z)) for z in (0.1, -0.01)
    )
    path = np.linspace(up, down, 9)
    assert robot.collision.meeting(path) is not None
    assert robot.collision.meeting(path, set(robot.collision.pairs)) is None


def test_clearance_falls_as_a_hand_comes_down(robot: RobotModel) -> None:
    """A hand lowered by 2 mm into the table loses 2 mm of its least room.

    Above the table, bounds of pairs that are far apart may be less than the hand's room.
    """
    rooms = [
        robot.collision.clearances(
            _configuration(robot, left=_hand_at(robot, "left", 0.0, -0.15, height))
        )
        for height in (-0.006, -0.008)
    ]
    assert rooms[0].min() < 0.0
    assert rooms[0].min() - rooms[1].min() == pytest.approx(0.002, abs=1e-5)
    least = robot.collision.nearer_than(rooms[1], float(rooms[1].min()))
    assert {TABLE} <= {c.second for c in least}


def test_a_touch_between_distant_free_postures_is_found(robot: RobotModel) -> None:
    """A hand that swings through the other one is caught though both ends are far from it."""
    across = [_hand_at(robot, "left", 0.0, y, 0.08) for y in (-0.30, 0.30)]
    still = _hand_at(robot, "right", 0.0, 0.0, 0.08)
    path = JointPath.straight(robot.joint_names(["left"]), *across)
    _, positions = path.densely(robot.collision.path_step)
    names = robot.joint_names(["right"])
    others = dict(zip(names, still.tolist(), strict=True))
    rows = robot.configurations(others, path.joint_names, positions, {})
    assert robot.collision.contact(rows[0]) is None
    meeting = robot.collision.meeting(rows)
    assert meeting is not None and {meeting.contact.first[0], meeting.contact.second[0]} == {
        "L",
        "R",
    }


@pytest.mark.parametrize("seed", range(6))
def test_what_a_path_keeps_is_proven(robot: RobotModel, seed: int) -> None:
    """Random moves pass if and only if looking at every row finds no more than the slack."""
    rng = np.random.default_rng(seed)
    checker, names = robot.collision, robot.joint_names(["left", "right"])
    rest = robot.rest_positions(["left", "right"])
    path = JointPath.straight(names, rest, rest + rng.normal(0.0, 0.25, len(rest)))
    _, positions = path.densely(robot.collision.path_step)
    rows = robot.configurations({}, names, positions, {})
    least = min(float(checker.clearances(q).min()) for q in rows[::4])
    if checker.meeting(rows) is None:
        assert least > -checker.config.slack
    else:
        assert least < checker.config.slack


def test_neighbours_on_a_densely_sampled_path_prove_it(robot: RobotModel) -> None:
    """However unevenly a path runs, no pair moves by more than twice the slack between rows."""
    rng = np.random.default_rng(3)
    checker, names = robot.collision, robot.joint_names(["left", "right"])
    rest = robot.rest_positions(["left", "right"])
    knots = np.cumsum(rng.choice([0.01, 1.0], 12))
    path = JointPath.through(names, rest + rng.normal(0.0, 0.2, (12, len(rest))), knots)
    _, positions = path.densely(checker.path_step)
    rows = robot.configurations({}, names, positions, {})
    steps = np.abs(np.diff(rows, axis=0))
    assert steps.max() <= checker.path_step * (1.0 + 1e-6)
    travel = max(float(checker.bound.travel(step).max()) for step in steps[::50])
    assert travel <= 2.0 * checker.config.slack
    assert len(rows) < 3.0 * np.abs(steps).sum(axis=0).max() / checker.path_step
