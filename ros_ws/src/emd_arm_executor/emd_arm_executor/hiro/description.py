"""HIRO's joints by group, their limits, and its named postures, from `hiro.yaml`.

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
from emd_arm_executor.robot_file import read_robot_file
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
    "ROBOT_FILE",
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


ROBOT_FILE = read_robot_file(URDF_PATH.with_name("hiro.yaml"))
_TIPS = {arm.group: arm.tool_frame for arm in ROBOT_FILE.arms.values()}

JOINT_GROUPS: Mapping[str, JointGroup] = MappingProxyType(
    {
        name: JointGroup(name, joints, _TIPS.get(name, ""))
        for name, joints in ROBOT_FILE.groups.items()
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


INITIAL, OFF, OBSERVE = (
    Posture(name, MappingProxyType(dict(ROBOT_FILE.poses[name])))
    for name in ("initial", "off", "observe")
)
