"""The robot model: its kinematics against published poses, its frames and its masses."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pybullet
import pytest

from emd_arm_executor.hiro.description import (
    INITIAL,
    JOINT_LIMITS,
    JOINT_NAMES,
    OFF,
    URDF_PATH,
    GripperGeometry,
    Posture,
)
from emd_arm_executor.hiro.figures.shapes import NAIL_LENGTH, tool_offset
from emd_arm_executor.hiro.make_urdf import build_urdf, write_urdf
from emd_arm_executor.hiro.world import HiroWorld
from emd_core.frames import FloatArray

pinocchio = pytest.importorskip("pinocchio")

# Hand positions in WAIST that HIRO's client and its IK test print for `goInitial`.
PUBLISHED_LEFT = (0.325563, 0.182364, 0.074625)
PUBLISHED_RIGHT = (0.325563, -0.182364, 0.074625)


def pinocchio_transform(posture: Posture, link: str) -> FloatArray:
    """Place a link by Pinocchio's forward kinematics."""
    model = pinocchio.buildModelFromUrdf(str(URDF_PATH))
    data = model.createData()
    angles = pinocchio.neutral(model)
    for joint, angle in posture.by_joint().items():
        angles[model.joints[model.getJointId(joint)].idx_q] = angle
    pinocchio.framesForwardKinematics(model, data, angles)
    return np.array(data.oMf[model.getFrameId(link)].homogeneous)


def test_committed_urdf_is_what_the_generator_writes(tmp_path) -> None:
    """The URDF in the repository is the generator's output, byte for byte."""
    write_urdf(tmp_path / "hiro.urdf")
    assert (tmp_path / "hiro.urdf").read_text() == URDF_PATH.read_text() == build_urdf()


@pytest.mark.parametrize(
    ("link", "published"),
    [("LARM_JOINT5_Link", PUBLISHED_LEFT), ("RARM_JOINT5_Link", PUBLISHED_RIGHT)],
)
def test_initial_pose_has_the_published_hand_positions(link: str, published) -> None:
    """At `goInitial` both hands are within 0.1 mm of the published positions, in both engines."""
    by_pinocchio = pinocchio_transform(INITIAL, link)[:3, 3]
    with HiroWorld(posture=INITIAL) as world:
        by_pybullet = world.transform_link_to_waist(link)[:3, 3]
    assert np.linalg.norm(by_pinocchio - published) < 1e-4
    assert np.linalg.norm(by_pybullet - published) < 1e-4


def test_off_pose_has_the_computed_hand_position() -> None:
    """At HIRO's `goOffPose` the left hand is where the facts' own kinematics put it."""
    position = pinocchio_transform(OFF, "LARM_JOINT5_Link")[:3, 3]
    assert position == pytest.approx((-0.08715, 0.34116, 0.4198), abs=2e-5)


@pytest.mark.parametrize(
    "link", ["left_tool", "right_tool", "camera_optical_frame", "LHAND_JOINT3_nail"]
)
def test_pybullet_and_pinocchio_agree_on_every_frame(link: str) -> None:
    """Fixed frames and fingers lie at the same place in both engines."""
    with HiroWorld(posture=OFF) as world:
        by_pybullet = world.transform_link_to_waist(link)
    assert by_pybullet == pytest.approx(pinocchio_transform(OFF, link), abs=1e-6)


@pytest.mark.parametrize("side", ["left", "right"])
def test_tool_frame_points_out_of_the_fingers(side: str) -> None:
    """With the hand down, z of the tool points down and x along the jaws' opening (y of WAIST)."""
    tool = pinocchio_transform(INITIAL, f"{side}_tool")[:3, :3]
    assert tool[:, 2] == pytest.approx((0, 0, -1), abs=3e-3)
    assert np.abs(tool[:, 0]) == pytest.approx((0, 1, 0), abs=3e-3)
    assert np.linalg.det(tool) == pytest.approx(1.0)


@pytest.mark.parametrize("prefix", ["L", "R"])
def test_tool_origin_lies_between_the_closed_nail_tips(prefix: str) -> None:
    """With the jaws closed the nails touch, and the tool's origin is the middle of their tips."""
    fingers = tuple(GripperGeometry().joints_from_width(0.0))
    groups = dict(INITIAL.groups) | {"left_gripper": fingers, "right_gripper": fingers}
    closed = Posture("closed", groups)
    tool = pinocchio_transform(closed, "left_tool" if prefix == "L" else "right_tool")
    tips = []
    for joint, inward in (("JOINT1", 1.0), ("JOINT3", -1.0)):
        nail = pinocchio_transform(closed, f"{prefix}HAND_{joint}_nail")
        tips.append(nail @ np.array([-0.030 - NAIL_LENGTH, inward * 0.017, 0.0, 1.0]))
    for tip in tips:
        assert tip[:3] == pytest.approx(tool[:3, 3], abs=1e-6)
    wrist = pinocchio_transform(closed, f"{prefix}ARM_JOINT5_Link")[:3, 3]
    assert np.linalg.norm(tool[:3, 3] - wrist) == pytest.approx(tool_offset())


def test_all_23_joints_are_there_with_their_limits() -> None:
    """The URDF has exactly HIRO's 23 moving joints, with the limits of the description."""
    robot = ET.parse(URDF_PATH).getroot()
    moving = {j.get("name"): j.find("limit") for j in robot.findall("joint[@type='revolute']")}
    assert sorted(moving) == sorted(JOINT_NAMES)
    assert len(moving) == 23
    for name, limit in moving.items():
        wanted = JOINT_LIMITS[name]
        got = [float(limit.get(key)) for key in ("lower", "upper", "velocity", "effort")]
        assert got == pytest.approx([wanted.lower, wanted.upper, wanted.speed, wanted.effort])


def test_arms_are_mirror_images() -> None:
    """Limits of the right arm are those of the left, mirrored; LARM_JOINT3 reaches 165 degrees."""
    for number in range(6):
        left, right = JOINT_LIMITS[f"LARM_JOINT{number}"], JOINT_LIMITS[f"RARM_JOINT{number}"]
        if number in (1, 2, 4):
            assert (right.lower, right.upper) == (left.lower, left.upper)
        else:
            assert (right.lower, right.upper) == (-left.upper, -left.lower)
    assert np.degrees(JOINT_LIMITS["LARM_JOINT3"].upper) == pytest.approx(165)


def test_masses_and_inertias_are_physical() -> None:
    """The model weighs what its links weigh, and every tensor meets the triangle inequality."""
    robot = ET.parse(URDF_PATH).getroot()
    total = 0.0
    for link in robot.findall("link"):
        total += float(link.find("inertial/mass").get("value"))
        tensor = {k: float(v) for k, v in link.find("inertial/inertia").attrib.items()}
        matrix = np.array(
            [
                [tensor["ixx"], tensor["ixy"], tensor["ixz"]],
                [tensor["ixy"], tensor["iyy"], tensor["iyz"]],
                [tensor["ixz"], tensor["iyz"], tensor["izz"]],
            ]
        )
        moments = np.linalg.eigvalsh(matrix)
        assert moments[0] > 0
        assert moments[0] + moments[1] >= moments[2] * (1 - 1e-6)
    # 19.758 kg of the published links and 0.4 kg of camera.
    assert total == pytest.approx(20.16, abs=0.01)


def test_every_shape_to_look_at_lies_near_its_solid() -> None:
    """What is drawn of a link stays within 25 mm of the box around what collides."""
    robot = ET.parse(URDF_PATH).getroot()
    for link in robot.findall("link"):
        solids, looks = link.findall("collision"), link.findall("visual")
        if not solids:
            continue
        low, high = _bounds(solids)
        look_low, look_high = _bounds(looks)
        # The mast between head and camera is the one part with no solid of its own.
        allowed = np.array(
            [0.025, 0.025, 0.07 if link.get("name") == "HEAD_JOINT1_Link" else 0.025]
        )
        assert (look_low > low - 0.025).all(), link.get("name")
        assert (look_high < high + allowed).all(), link.get("name")


def _bounds(shapes: list[ET.Element]) -> tuple[FloatArray, FloatArray]:
    corners = []
    for shape in shapes:
        geometry = shape.find("geometry/*")
        if geometry.tag == "box":
            half = np.array([float(v) for v in geometry.get("size").split()]) / 2
        else:
            radius, length = float(geometry.get("radius")), float(geometry.get("length"))
            half = np.array([radius, radius, length / 2])
        origin = shape.find("origin")
        rotation = np.array(
            pybullet.getMatrixFromQuaternion(
                pybullet.getQuaternionFromEuler([float(v) for v in origin.get("rpy").split()])
            )
        ).reshape(3, 3)
        extent = np.abs(rotation) @ half
        centre = np.array([float(v) for v in origin.get("xyz").split()])
        corners += [centre - extent, centre + extent]
    return np.min(corners, axis=0), np.max(corners, axis=0)
