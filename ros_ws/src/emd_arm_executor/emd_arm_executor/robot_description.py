"""What the executor must know about a robot and its table; HIRO's answer is at the end."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from emd_arm_executor.hiro import description as hiro
from emd_arm_executor.kinematics import ArmGroup
from emd_core.frames import FloatArray


@dataclass(frozen=True)
class ArmDescription:
    """One arm with its hand.

    Attributes:
        group: Joints from shoulder to wrist, and the tool frame.
        controller: Name of the joint group that moves the arm.
        gripper_joint_names: Joints of the hand.
        fingertip_links: Links that may touch the table.
    """

    group: ArmGroup
    controller: str
    gripper_joint_names: tuple[str, ...]
    fingertip_links: tuple[str, ...]


@dataclass(frozen=True)
class RobotDescription:
    """A robot with up to two arms in front of a table.

    Attributes:
        urdf: File of the robot's model; its collision shapes are primitives.
        arms: The arms by name.
        rest: Positions of all joints at which the arms wait beside the table, radians. Joints
            that belong to no arm stay there.
        allowed_overlap: How far the primitives of a pair of links may overlap, metres, where they
            are known to be larger than the links.
        gripper_joints_from_width: Positions of a hand's joints for an opening in metres.
        transform_table_to_base: The table frame in the robot's base frame, shape (4, 4).
        table_centre_in_base: Middle of the table top's box, shape (3,), metres.
        table_size: Edge lengths of that box along the base frame's axes, shape (3,), metres.
    """

    urdf: Path
    arms: Mapping[str, ArmDescription]
    rest: Mapping[str, float]
    allowed_overlap: Mapping[frozenset[str], float]
    gripper_joints_from_width: Callable[[float], FloatArray]
    transform_table_to_base: FloatArray
    table_centre_in_base: FloatArray
    table_size: FloatArray


# Bounding boxes stand for HIRO's chest and elbow link (ARM_JOINT2); a cylinder around the latter
# would keep 26 mm more distance in the postures that the near corners of the cloth need. HIRO's
# published collision matrix has no posture at all in which its left elbow link touches chest or
# waist. So the margin is left off, though the boxes may not overlap: the simulation has them too.
_HIRO_ALLOWED_OVERLAP = {
    frozenset({body, f"{side}ARM_JOINT2_Link"}): 0.0
    for body in ("CHEST_JOINT0_Link", "WAIST")
    for side in ("L", "R")
}


def hiro_description(
    geometry: hiro.CellGeometry | None = None, rest: hiro.Posture | None = None
) -> RobotDescription:
    """Describe HIRO at its table.

    Args:
        geometry: Where the table stands; the default cell if None.
        rest: Posture in which the arms wait; out of the camera's view if None.
    """
    geometry = geometry or hiro.CellGeometry()
    return RobotDescription(
        urdf=hiro.URDF_PATH,
        arms={hand: _hiro_arm(hand) for hand in hiro.HANDS},
        rest=(rest or hiro.OBSERVE).by_joint(),
        allowed_overlap=_HIRO_ALLOWED_OVERLAP,
        gripper_joints_from_width=hiro.GripperGeometry().joints_from_width,
        transform_table_to_base=geometry.transform_table_to_waist,
        table_centre_in_base=np.asarray(geometry.table_centre_in_waist),
        table_size=np.array(geometry.table_size),
    )


def _hiro_arm(hand: str) -> ArmDescription:
    arm, gripper = hiro.joint_group(f"{hand}_arm"), hiro.joint_group(f"{hand}_gripper")
    return ArmDescription(
        group=ArmGroup(hand, arm.joints, arm.tip),
        controller=arm.name,
        gripper_joint_names=gripper.joints,
        # Joints 1 and 3 carry the distal finger links with the nails.
        fingertip_links=(f"{gripper.joints[1]}_nail", f"{gripper.joints[3]}_nail"),
    )
