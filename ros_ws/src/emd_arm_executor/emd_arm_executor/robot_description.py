"""What the executor must know about a robot and its table, read from the robot's file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from emd_arm_executor.arm_group import ArmGroup
from emd_arm_executor.gripper_law import GripperLaw, SlidingFingers, gripper_law
from emd_arm_executor.hiro import description as hiro
from emd_arm_executor.robot_file import RobotFile, read_robot_file
from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray

_LAWS: Mapping[str, type[GripperLaw]] = {
    "swinging_fingers": hiro.GripperGeometry,
    "sliding_fingers": SlidingFingers,
}


@dataclass(frozen=True)
class ArmDescription:
    """One arm with its hand.

    Attributes:
        group: Joints from shoulder to wrist, and the tool frame.
        controller: Name of the joint group that moves the arm.
        gripper_controller: Name of the joint group that moves the hand.
        gripper_joint_names: Joints of the hand.
        fingertip_links: Links that may touch the table.
    """

    group: ArmGroup
    controller: str
    gripper_controller: str
    gripper_joint_names: tuple[str, ...]
    fingertip_links: tuple[str, ...]


@dataclass(frozen=True)
class TorsoDescription:
    """A joint that turns all arms alike.

    Attributes:
        controller: Name of the joint group that moves it.
        joint_name: The joint.
    """

    controller: str
    joint_name: str


@dataclass(frozen=True)
class RobotDescription:
    """A robot with up to two arms in front of a table.

    Attributes:
        urdf: File of the robot's model; its collision shapes are primitives.
        arms: The arms by name.
        rest: Positions of all joints at which the arms wait beside the table, radians. Joints
            that belong to no arm stay there, the torso's excepted.
        pair_margins: Distance that the primitives of a pair of links keep, metres, instead of
            `CollisionConfig.margin`, where they are known to be larger than the links; negative
            where they may overlap.
        gripper: The hands' opening law.
        transform_table_to_base: The table frame in the robot's base frame, shape (4, 4).
        table_centre_in_base: Middle of the table top's box, shape (3,), metres.
        table_size: Edge lengths of that box along the base frame's axes, shape (3,), metres.
        torso: What turns all arms; None if nothing does.
    """

    urdf: Path
    arms: Mapping[str, ArmDescription]
    rest: Mapping[str, float]
    pair_margins: Mapping[frozenset[str], float]
    gripper: GripperLaw
    transform_table_to_base: FloatArray
    table_centre_in_base: FloatArray
    table_size: FloatArray
    torso: TorsoDescription | None = None

    @property
    def controllers(self) -> dict[str, tuple[str, ...]]:
        """Joints of each group that moves an arm or the torso, by the group's name."""
        groups = {arm.controller: arm.group.joint_names for arm in self.arms.values()}
        if self.torso is not None:
            groups[self.torso.controller] = (self.torso.joint_name,)
        return groups


def load_description(path: Path) -> RobotDescription:
    """Read a robot's YAML file.

    Args:
        path: The file; `hiro/hiro.yaml` is an example with every key.

    Raises:
        InvalidInputError: If the file or a figure in it does not have the form that is wanted.
    """
    file = read_robot_file(path)
    figures: dict[str, Any] = {
        key: tuple(value) if isinstance(value, list) else value
        for key, value in file.table.items()
    }
    try:
        geometry = hiro.CellGeometry(**figures)
    except TypeError as err:
        raise InvalidInputError(f"{path}: table: {err}") from err
    return _describe(file, geometry)


def hiro_description(
    geometry: hiro.CellGeometry | None = None, rest: hiro.Posture | None = None
) -> RobotDescription:
    """Describe HIRO at its table.

    Args:
        geometry: Where the table stands; the default cell if None.
        rest: Posture in which the arms wait; that of `hiro.yaml` if None.
    """
    description = _describe(hiro.ROBOT_FILE, geometry or hiro.CellGeometry())
    return description if rest is None else replace(description, rest=rest.by_joint())


def _describe(file: RobotFile, geometry: hiro.CellGeometry) -> RobotDescription:
    return RobotDescription(
        urdf=file.urdf,
        arms={name: _arm(file, name) for name in file.arms},
        rest=file.rest_by_joint,
        pair_margins=file.pair_margins,
        gripper=gripper_law(file.gripper_law, _LAWS),
        transform_table_to_base=geometry.transform_table_to_waist,
        table_centre_in_base=np.asarray(geometry.table_centre_in_waist),
        table_size=np.array(geometry.table_size),
        torso=_torso(file),
    )


def _arm(file: RobotFile, name: str) -> ArmDescription:
    entry = file.arms[name]
    joints = file.groups[entry.group]
    limits = {j: limit for j, limit in file.position_limits.items() if j in joints}
    return ArmDescription(
        group=ArmGroup(name, joints, entry.tool_frame, limits),
        controller=entry.group,
        gripper_controller=entry.gripper,
        gripper_joint_names=file.groups[entry.gripper],
        fingertip_links=entry.fingertips,
    )


def _torso(file: RobotFile) -> TorsoDescription | None:
    if file.torso is None:
        return None
    joints = file.groups[file.torso]
    if len(joints) != 1:
        raise InvalidInputError(f"a torso of one joint is wanted, {file.torso} has {joints}")
    return TorsoDescription(file.torso, joints[0])
