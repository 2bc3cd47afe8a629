"""The rigid-body world: holding, moving, limits, contacts."""

from __future__ import annotations

import numpy as np
import pybullet
import pytest

from emd_arm_executor.hiro.contacts import side_of, watched_pairs
from emd_arm_executor.hiro.description import (
    JOINT_GROUPS,
    JOINT_LIMITS,
    JOINT_NAMES,
    OBSERVE,
    OFF,
    CellGeometry,
)
from emd_arm_executor.hiro.world import HiroWorld, WorldConfig
from emd_core.errors import InvalidInputError


def test_servos_hold_a_posture_against_gravity(world) -> None:
    """After two seconds no joint has sagged by more than 0.2 mrad, and all are at rest."""
    for _ in range(480):
        world.step()
    wanted = np.array([OBSERVE.by_joint()[name] for name in JOINT_NAMES])
    assert np.abs(world.joint_positions - wanted).max() < 2e-4
    assert np.abs(world.joint_velocities).max() < 1e-3


def test_efforts_carry_the_arms_weight(world) -> None:
    """Shoulder servos give some newton metres; with the chest upright its servo gives none."""
    for _ in range(120):
        world.step()
    efforts = dict(zip(JOINT_NAMES, world.joint_efforts, strict=True))
    assert 3 < abs(efforts["LARM_JOINT1"]) < 20
    assert efforts["LARM_JOINT1"] == pytest.approx(efforts["RARM_JOINT1"], rel=1e-3)
    assert abs(efforts["CHEST_JOINT0"]) < 0.1


def test_weightless_robot_needs_no_effort() -> None:
    """Without gravity the servos of a robot at rest do nothing."""
    with HiroWorld(WorldConfig(gravity=0.0)) as world:
        for _ in range(60):
            world.step()
        assert np.abs(world.joint_efforts).max() < 1e-6


def test_joints_reach_their_targets_within_the_speed_limit(world) -> None:
    """A far target is reached at the joint's limit, a little above it only while catching up."""
    start = world.joint_positions
    joint = JOINT_NAMES.index("LARM_JOINT0")
    world.set_joint_targets({"LARM_JOINT0": start[joint] - 1.0})
    speeds = []
    for _ in range(240):
        world.step()
        speeds.append(abs(world.joint_velocities[joint]))
    moved = world.joint_positions - start
    assert moved[joint] == pytest.approx(-1.0, abs=1e-3)
    limit = JOINT_LIMITS["LARM_JOINT0"].speed
    assert max(speeds) < 1.25 * limit
    assert max(speeds[24:]) < 1.01 * limit
    moved[joint] = 0
    assert np.abs(moved).max() < 2e-3


@pytest.mark.parametrize(
    ("targets", "words"),
    [
        ({"LARM_JOINT9": 0.0}, "LARM_JOINT9"),
        ({"LARM_JOINT2": 0.3}, "LARM_JOINT2 moves"),
        ({"HEAD_JOINT1": float("nan")}, "finite"),
    ],
)
def test_bad_targets_are_refused_and_change_nothing(world, targets, words: str) -> None:
    """Unknown joints, limits and NaN raise, and the robot stays where it is."""
    with pytest.raises(InvalidInputError, match=words):
        world.set_joint_targets({"RARM_JOINT0": 0.0} | targets)
    for _ in range(60):
        world.step()
    wanted = np.array([OBSERVE.by_joint()[name] for name in JOINT_NAMES])
    assert np.abs(world.joint_positions - wanted).max() < 2e-4


def test_two_worlds_do_not_share_state() -> None:
    """Each world has its own PyBullet client."""
    with HiroWorld() as first, HiroWorld(posture=OFF) as second:
        first.step()
        assert np.abs(first.joint_positions - second.joint_positions).max() > 0.5


def test_same_targets_give_the_same_motion() -> None:
    """The world is deterministic."""
    runs = []
    for _ in range(2):
        with HiroWorld() as world:
            world.set_joint_targets({"LARM_JOINT0": 0.2, "RARM_JOINT3": 1.0})
            for _ in range(100):
                world.step()
            runs.append(world.joint_positions)
    assert np.array_equal(runs[0], runs[1])


def test_close_may_be_called_twice() -> None:
    """Leaving a closed world is harmless."""
    world = HiroWorld()
    world.close()
    world.close()
    with pytest.raises(pybullet.error):
        world.step()


def test_a_groups_positions_are_those_of_its_joints(world) -> None:
    """Whichever joints are asked for, each has its own value."""
    world.set_joint_targets({"LARM_JOINT0": 0.2, "RARM_JOINT3": -1.2, "RHAND_JOINT1": 0.1})
    for _ in range(50):
        world.step()
    by_name = dict(zip(JOINT_NAMES, world.joint_positions, strict=True))
    for name, group in JOINT_GROUPS.items():
        assert world.group_positions(name).tolist() == [by_name[j] for j in group.joints]


def test_tool_transform_is_in_the_table_frame(world) -> None:
    """The left hand is at negative y of the table frame, the right one mirrors it."""
    left, right = world.tool_transform_in_table(0), world.tool_transform_in_table(1)
    assert left[1, 3] < -0.4
    assert right[:3, 3] == pytest.approx(left[:3, 3] * (1, -1, 1), abs=1e-6)
    geometry = world.geometry
    in_waist = geometry.transform_table_to_waist @ left
    assert in_waist == pytest.approx(world.transform_link_to_waist("left_tool"))


def test_hand_on_the_table_is_reported(world) -> None:
    """A hand lowered onto the table touches it with its nails, and the servo stops there."""
    world.set_joint_targets({"LARM_JOINT0": 0.01, "LARM_JOINT1": 0.02, "LARM_JOINT2": -1.70})
    world.set_joint_targets({"LARM_JOINT4": 0.11, "RARM_JOINT0": -1.3})
    for _ in range(480):
        world.step()
    contacts = world.contacts()
    assert contacts
    assert {c.link_b for c in contacts} == {"table"}
    assert all(c.link_a.endswith("_nail") and c.depth < 0.003 for c in contacts)
    height = CellGeometry().table_origin_in_waist[2]
    assert all(abs(c.position_in_waist[2] - height) < 0.003 for c in contacts)


def test_crossed_arms_are_reported(world) -> None:
    """Arms that swing into each other touch, and do not pass through."""
    world.set_joint_targets({"LARM_JOINT0": -0.9, "RARM_JOINT0": 0.9})
    found = set()
    for _ in range(480):
        world.step()
        found |= {(c.link_a, c.link_b) for c in world.contacts() if c.is_arm_to_arm}
    assert found
    assert all({side_of(a), side_of(b)} == {"left", "right"} for a, b in found)


def test_watched_pairs_leave_out_an_arms_own_links() -> None:
    """Links of one side are never a pair; left and right always are, wrists and body too."""
    links = ["WAIST", "CHEST_JOINT0_Link", "LARM_JOINT1_Link", "LARM_JOINT4_Link"]
    pairs = set(watched_pairs([*links, "RHAND_JOINT1_Link"]))
    assert ("LARM_JOINT1_Link", "LARM_JOINT4_Link") not in pairs
    assert ("WAIST", "CHEST_JOINT0_Link") not in pairs
    assert ("CHEST_JOINT0_Link", "LARM_JOINT1_Link") not in pairs
    assert ("CHEST_JOINT0_Link", "LARM_JOINT4_Link") in pairs
    assert ("LARM_JOINT1_Link", "RHAND_JOINT1_Link") in pairs


def test_ray_meets_the_table(world) -> None:
    """A ray straight down on the table is as long as the height above it."""
    x, y, z = world.geometry.table_origin_in_waist
    assert world.ray_distance((x, y, 0.5), (x, y, -1.0)) == pytest.approx(0.5 - z, abs=1e-4)
    assert world.ray_distance((x, y, 0.5), (x, y, 1.0)) == float("inf")


@pytest.mark.parametrize("wrong", [{"time_step": 0.0}, {"position_gain": 2.0}])
def test_bad_constants_are_refused(wrong) -> None:
    """A zero step and gains above 1 raise."""
    with pytest.raises(InvalidInputError):
        WorldConfig(**wrong)
