"""Write HIRO's URDF from its published figures: `python -m emd_arm_executor.hiro.make_urdf`.

An original work from figures; no mesh or model file of others went into it. Beyond the published
23 joints it has fixed links: the nails on the fingertips, a tool frame per hand, and the camera.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path

from emd_arm_executor.hiro.figures.inertias import FINGER_INERTIA, INERTIAS, mirror_inertia
from emd_arm_executor.hiro.figures.joints import TORSO_AND_HEAD, arm_joints, hand_joints
from emd_arm_executor.hiro.figures.looks import COLOURS, LOOKS
from emd_arm_executor.hiro.figures.records import Inertia, JointFigures, Shape, Vector
from emd_arm_executor.hiro.figures.shapes import (
    CAMERA_PITCH_DEGREES,
    CAMERA_POSITION,
    KINECT_BODY,
    SOLIDS,
    finger_shapes,
    mirror_shape,
    nail_shape,
    tool_offset,
)
from emd_core.whole_file import write_text

URDF_PATH = Path(__file__).with_name("hiro.urdf")

# Joint damping as in the published URDFs; friction is zero there.
_DAMPING = 0.2
# Links that carry no mass of their own; an omitted mass would count as 1 kg in PyBullet.
_MASSLESS = Inertia(1e-4, (0, 0, 0), (1e-8, 1e-8, 1e-8, 0, 0, 0))
# Mass of a Kinect without its stand, from its inertia as a box; not a published figure of HIRO.
_CAMERA_INERTIA = Inertia(0.4, (-0.037, 0, 0), (2.7e-3, 2.8e-4, 2.7e-3, 0, 0, 0))

# z of the tool frame is -x of the hand's last link (out of the fingers), its x is the link's y
# (along the jaws' opening).
_TOOL_RPY: Vector = (-90.0, 0.0, 90.0)
# Optical frame: z forward, x right, y down, against the camera link's x forward, y left, z up.
_OPTICAL_RPY: Vector = (-90.0, 0.0, -90.0)


def build_urdf() -> str:
    """Return the URDF as text."""
    robot = ET.Element("robot", name="hiro")
    for name, rgb in COLOURS.items():
        material = ET.SubElement(robot, "material", name=name)
        ET.SubElement(material, "color", rgba=_numbers((*rgb, 1.0)))
    _add_link(robot, "WAIST", INERTIAS["WAIST"], SOLIDS["WAIST"])
    for joint in TORSO_AND_HEAD:
        link = f"{joint.name}_Link"
        _add_joint_and_link(robot, joint, INERTIAS[link], SOLIDS[link])
    for side in ("L", "R"):
        _add_arm(robot, side)
        _add_hand(robot, side)
    _add_camera(robot)
    ET.indent(robot, "  ")
    header = '<?xml version="1.0"?>\n<!-- Written by emd_arm_executor.hiro.make_urdf. -->\n'
    return header + ET.tostring(robot, encoding="unicode") + "\n"


def write_urdf(path: Path = URDF_PATH) -> None:
    """Write the URDF; the file appears whole or not at all."""
    write_text(path, build_urdf())


def _add_arm(robot: ET.Element, side: str) -> None:
    for joint in arm_joints(side):
        left_link = f"L{joint.name[1:]}_Link"
        inertia, shapes = INERTIAS[left_link], SOLIDS[left_link]
        if side == "R":
            inertia = mirror_inertia(inertia)
            shapes = tuple(mirror_shape(shape) for shape in shapes)
        _add_joint_and_link(robot, joint, inertia, shapes)


def _add_hand(robot: ET.Element, side: str) -> None:
    for number, joint in enumerate(hand_joints(side)):
        _add_joint_and_link(robot, joint, FINGER_INERTIA, finger_shapes(number))
        if number in (1, 3):
            nail = f"{joint.name}_nail"
            _add_link(robot, nail, _MASSLESS, (nail_shape(number),))
            _add_fixed_joint(robot, f"{joint.name}_Link", nail)
    tool = "left_tool" if side == "L" else "right_tool"
    _add_link(robot, tool, _MASSLESS, ())
    _add_fixed_joint(
        robot, f"{side}ARM_JOINT5_Link", tool, origin=(-tool_offset(), 0, 0), rpy=_TOOL_RPY
    )


def _add_camera(robot: ET.Element) -> None:
    _add_link(robot, "camera_link", _CAMERA_INERTIA, (KINECT_BODY,))
    rpy = (0.0, CAMERA_PITCH_DEGREES, 0.0)
    _add_fixed_joint(robot, "HEAD_JOINT1_Link", "camera_link", origin=CAMERA_POSITION, rpy=rpy)
    _add_link(robot, "camera_optical_frame", _MASSLESS, ())
    _add_fixed_joint(robot, "camera_link", "camera_optical_frame", rpy=_OPTICAL_RPY)


def _add_joint_and_link(
    robot: ET.Element, joint: JointFigures, inertia: Inertia, solids: Sequence[Shape]
) -> None:
    link = f"{joint.name}_Link"
    _add_link(robot, link, inertia, solids)
    element = ET.SubElement(robot, "joint", name=joint.name, type="revolute")
    _add_origin(element, joint.origin, (joint.roll, 0, 0))
    ET.SubElement(element, "parent", link=joint.parent)
    ET.SubElement(element, "child", link=link)
    ET.SubElement(element, "axis", xyz=_numbers(joint.axis))
    ET.SubElement(
        element,
        "limit",
        lower=_number(math.radians(joint.lower)),
        upper=_number(math.radians(joint.upper)),
        velocity=_number(math.radians(joint.speed)),
        effort=_number(joint.effort),
    )
    ET.SubElement(element, "dynamics", damping=_number(_DAMPING), friction="0")


def _add_fixed_joint(
    robot: ET.Element,
    parent: str,
    child: str,
    origin: Vector = (0, 0, 0),
    rpy: Vector = (0, 0, 0),
) -> None:
    element = ET.SubElement(robot, "joint", name=f"{child}_fixed", type="fixed")
    _add_origin(element, origin, rpy)
    ET.SubElement(element, "parent", link=parent)
    ET.SubElement(element, "child", link=child)


def _add_link(robot: ET.Element, name: str, inertia: Inertia, solids: Sequence[Shape]) -> None:
    link = ET.SubElement(robot, "link", name=name)
    inertial = ET.SubElement(link, "inertial")
    _add_origin(inertial, inertia.centre, (0, 0, 0))
    ET.SubElement(inertial, "mass", value=_number(inertia.mass))
    keys = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    values = {key: _number(value) for key, value in zip(keys, inertia.tensor, strict=True)}
    ET.SubElement(inertial, "inertia", values)
    for shape in _looks_of(name) or solids:
        visual = ET.SubElement(link, "visual")
        _add_geometry(visual, shape)
        ET.SubElement(visual, "material", name=shape.colour)
    for shape in solids:
        _add_geometry(ET.SubElement(link, "collision"), shape)


def _looks_of(link: str) -> Sequence[Shape]:
    if link.startswith("RARM"):
        return tuple(mirror_shape(shape) for shape in LOOKS.get(f"L{link[1:]}", ()))
    return LOOKS.get(link, ())


def _add_geometry(parent: ET.Element, shape: Shape) -> None:
    _add_origin(parent, shape.centre, shape.rpy)
    geometry = ET.SubElement(parent, "geometry")
    if shape.kind == "box":
        ET.SubElement(geometry, "box", size=_numbers(shape.size))
    elif shape.kind == "cylinder":
        radius, length = shape.size
        ET.SubElement(geometry, "cylinder", radius=_number(radius), length=_number(length))
    else:
        ET.SubElement(geometry, "sphere", radius=_number(shape.size[0]))


def _add_origin(parent: ET.Element, xyz: Vector, rpy_degrees: Vector) -> None:
    rpy = [math.radians(angle) for angle in rpy_degrees]
    ET.SubElement(parent, "origin", xyz=_numbers(xyz), rpy=_numbers(rpy))


def _numbers(values: Sequence[float]) -> str:
    return " ".join(_number(value) for value in values)


def _number(value: float) -> str:
    return f"{value + 0.0:.10g}"


if __name__ == "__main__":
    write_urdf()
