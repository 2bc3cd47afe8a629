"""HIRO's joints by group, their limits, and its named postures.

Hand 0 is the left one, hand 1 the right one, wherever hands are numbered.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from emd_arm_executor.hiro.cell_geometry import (
    CellGeometry,
    transform_camera_to_table,
    transform_camera_to_waist,
)
from emd_arm_executor.hiro.figures.joints import all_joints
from emd_arm_executor.hiro.gripper import GripperGeometry
from emd_arm_executor.hiro.make_urdf import URDF_PATH
from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray

__all__ = [
    "HANDS",
    "INITIAL",
    "JOINT_GROUPS",
    "JOINT_LIMITS",
    "JOINT_NAMES",
    "OBSERVE",
    "OFF",
    "URDF_PATH",
    "CellGeometry",
    "GripperGeometry",
    "JointGroup",
    "JointLimits",
    "Posture",
    "joint_group",
    "transform_camera_to_table",
    "transform_camera_to_waist",
]

HANDS = ("left", "right")


@dataclass(frozen=True)
class JointGroup:
    """Joints that one controller moves.

    Attributes:
        name: left_arm, right_arm, left_gripper, right_gripper, torso or head.
        joints: Joint names, from the root outwards.
        tip: Link whose pose the group places; empty for grippers, torso and head.
    """

    name: str
    joints: tuple[str, ...]
    tip: str = ""


@dataclass(frozen=True)
class JointLimits:
    """What a joint may do.

    Attributes:
        lower: Lower position limit, radians.
        upper: Upper position limit, radians.
        speed: Largest speed, rad/s.
        effort: Largest torque, Nm.
    """

    lower: float
    upper: float
    speed: float
    effort: float


@dataclass(frozen=True)
class Posture:
    """A named posture of the whole robot.

    Attributes:
        name: What it is called.
        groups: Angles of every joint group, radians, in the order of the group's joints.
    """

    name: str
    groups: Mapping[str, tuple[float, ...]] = field(hash=False)

    def positions(self, group: str) -> FloatArray:
        """Angles of one group's joints, shape (joints,), radians."""
        joint_group(group)
        return np.array(self.groups[group])

    def by_joint(self) -> dict[str, float]:
        """Angles of all joints by name, radians."""
        return {
            joint: angle
            for group in JOINT_GROUPS.values()
            for joint, angle in zip(group.joints, self.groups[group.name], strict=True)
        }


def joint_group(name: str) -> JointGroup:
    """Find a group by its name.

    Raises:
        InvalidInputError: If there is no such group.
    """
    if name not in JOINT_GROUPS:
        raise InvalidInputError(f"a joint group of {sorted(JOINT_GROUPS)} is wanted, got {name!r}")
    return JOINT_GROUPS[name]


def _numbered(stem: str, count: int) -> tuple[str, ...]:
    return tuple(f"{stem}_JOINT{number}" for number in range(count))


JOINT_GROUPS: Mapping[str, JointGroup] = MappingProxyType(
    {
        group.name: group
        for group in (
            JointGroup("torso", ("CHEST_JOINT0",)),
            JointGroup("head", _numbered("HEAD", 2)),
            JointGroup("left_arm", _numbered("LARM", 6), tip="left_tool"),
            JointGroup("left_gripper", _numbered("LHAND", 4)),
            JointGroup("right_arm", _numbered("RARM", 6), tip="right_tool"),
            JointGroup("right_gripper", _numbered("RHAND", 4)),
        )
    }
)

JOINT_NAMES: tuple[str, ...] = tuple(j for group in JOINT_GROUPS.values() for j in group.joints)

JOINT_LIMITS: Mapping[str, JointLimits] = MappingProxyType(
    {
        joint.name: JointLimits(
            math.radians(joint.lower),
            math.radians(joint.upper),
            math.radians(joint.speed),
            joint.effort,
        )
        for joint in all_joints()
    }
)


def _posture(
    name: str, left_arm: tuple[float, ...], head: tuple[float, float], hand_width: float
) -> Posture:
    """Mirror the left arm's angles (degrees) to the right and open both hands by the same."""
    arm = np.radians(left_arm)
    fingers = tuple(GripperGeometry().joints_from_width(hand_width).tolist())
    return Posture(
        name,
        MappingProxyType(
            {
                "torso": (0.0,),
                "head": tuple(np.radians(head).tolist()),
                "left_arm": tuple(arm.tolist()),
                "right_arm": tuple((arm * (-1, 1, 1, -1, 1, -1)).tolist()),
                "left_gripper": fingers,
                "right_gripper": fingers,
            }
        ),
    )


_ZERO_WIDTH = 2 * GripperGeometry().half_gap

# Published: `goInitial` (init_pose_type 0) and `goOffPose` of HIRO's client.
INITIAL = _posture("initial", (0.6, 0, -100, -15.2, 9.4, -3.2), (0, 0), _ZERO_WIDTH)
OFF = _posture("off", (-25, -139, -157, -45, 0, 0), (0, 0), _ZERO_WIDTH)

# Own choice: both arms swung out to the sides, hands down, so that no part of the robot is in the
# picture of the head camera, whose axis meets the table frame's origin.
OBSERVE = _posture("observe", (75, -43, -105, -8, 37, 0), (0, 50), _ZERO_WIDTH)
