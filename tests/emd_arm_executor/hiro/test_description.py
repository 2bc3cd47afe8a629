"""Joint groups and named postures."""

from __future__ import annotations

import numpy as np
import pytest

from emd_arm_executor.hiro.description import (
    INITIAL,
    JOINT_GROUPS,
    JOINT_LIMITS,
    JOINT_NAMES,
    OBSERVE,
    OFF,
    joint_group,
)
from emd_arm_executor.hiro.world import HiroWorld
from emd_core.errors import InvalidInputError

POSTURES = (INITIAL, OFF, OBSERVE)


def test_groups_share_out_all_joints() -> None:
    """Every joint belongs to exactly one group."""
    assert len(JOINT_NAMES) == len(set(JOINT_NAMES)) == len(JOINT_LIMITS) == 23
    assert set(JOINT_NAMES) == set(JOINT_LIMITS)


@pytest.mark.parametrize("posture", POSTURES, ids=lambda p: p.name)
def test_postures_lie_inside_the_limits(posture) -> None:
    """No named posture asks a joint for more than it can do."""
    for joint, angle in posture.by_joint().items():
        assert JOINT_LIMITS[joint].lower <= angle <= JOINT_LIMITS[joint].upper, joint


@pytest.mark.parametrize("posture", (OFF, OBSERVE), ids=lambda p: p.name)
def test_robot_touches_nothing_in_a_posture(posture) -> None:
    """In the off and observe postures no arm touches table, body or the other arm."""
    with HiroWorld(posture=posture) as world:
        assert world.contacts() == []


def test_initial_pose_with_nails_reaches_into_this_table() -> None:
    """The published `goInitial` is no posture for this cell: its nails would be in the table."""
    with HiroWorld(posture=INITIAL) as world:
        assert {contact.link_b for contact in world.contacts()} == {"table"}


def test_postures_are_symmetric() -> None:
    """The right arm mirrors the left one in every named posture."""
    for posture in POSTURES:
        mirrored = posture.positions("left_arm") * (-1, 1, 1, -1, 1, -1)
        assert posture.positions("right_arm") == pytest.approx(mirrored)


def test_unknown_group_is_refused() -> None:
    """A group that does not exist is named in the error."""
    with pytest.raises(InvalidInputError, match="tail"):
        joint_group("tail")
    with pytest.raises(InvalidInputError, match="tail"):
        OBSERVE.positions("tail")


def test_positions_of_a_group_follow_its_joints() -> None:
    """`positions` and `by_joint` tell the same angles."""
    for name, group in JOINT_GROUPS.items():
        by_joint = OBSERVE.by_joint()
        wanted = np.array([by_joint[joint] for joint in group.joints])
        assert OBSERVE.positions(name) == pytest.approx(wanted)
