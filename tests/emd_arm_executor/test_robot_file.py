"""Descriptions of robots, read from YAML."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import emd_arm_executor
from emd_arm_executor.executor import MotionExecutor
from emd_arm_executor.gripper_law import SlidingFingers
from emd_arm_executor.mock_robot import MockRobot
from emd_arm_executor.motion_planner import MotionPlanner
from emd_arm_executor.robot_description import hiro_description, load_description
from emd_arm_executor.robot_file import read_robot_file
from emd_arm_executor.robot_model import RobotModel
from emd_arm_executor.silhouette import Silhouette
from emd_core.errors import InvalidInputError
from emd_core.manipulation import Manipulation

PACKAGE = Path(emd_arm_executor.__file__).parent
DUAL_ARM = PACKAGE / "dual_arm" / "dual_arm.yaml"
HIRO = PACKAGE / "hiro" / "hiro.yaml"


@pytest.fixture()
def changed(tmp_path: Path) -> Callable[[Callable[[dict[str, Any]], None]], Path]:
    """Writes HIRO's description with a change."""

    def write(change: Callable[[dict[str, Any]], None]) -> Path:
        content = yaml.safe_load(HIRO.read_text())
        change(content)
        path = tmp_path / "robot.yaml"
        path.write_text(yaml.safe_dump(content))
        return path

    return write


def test_hiro_is_what_its_file_says() -> None:
    """The file read anew describes the robot that the cell uses."""
    read, used = load_description(HIRO), hiro_description()
    assert read.rest == used.rest and read.arms == used.arms
    assert read.controllers == used.controllers
    assert list(read.controllers) == ["left_arm", "right_arm", "torso"]
    assert np.array_equal(read.transform_table_to_base, used.transform_table_to_base)


def test_a_second_robot_needs_a_description_only(
    towel: Callable[..., Silhouette], task: Callable[..., Manipulation]
) -> None:
    """Two arms of seven joints fold a cloth in half; nothing but their YAML and URDF is new."""
    robot = RobotModel(load_description(DUAL_ARM))
    mock = MockRobot(dict(robot.description.rest))
    fold = task([[-0.15, -0.15], [-0.15, 0.15]], [0.25, 0.0])
    plan = MotionPlanner(robot).plan_motion(fold, towel(side=0.30), mock.joint_positions())
    MotionExecutor(mock, robot).run(plan)
    assert len(plan.grasps) == 2
    assert {sent.group for sent in mock.sent} == {"left_arm", "right_arm"}
    carried = plan.via_poses_in_table["left"]
    moved = carried[-1][:2, 3] - carried[0][:2, 3]
    assert moved == pytest.approx(plan.displacements_in_table["left"], abs=1e-9)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda c: c.pop("arms"), "missing: .*arms"),
        (lambda c: c.update(legs=2), "unknown: .*legs"),
        (lambda c: c["arms"]["left"].pop("tool_frame"), "arm left needs"),
        (lambda c: c["arms"]["left"].update(group="left_leg"), "left_leg"),
        (lambda c: c.update(rest="asleep"), "rest should be one of"),
        (lambda c: c["poses"]["observe"].update(head=[1, 2, 3]), "pose observe"),
        (lambda c: c["poses"]["observe"].update(left_gripper=[0, 0, 0, 0]), "pose observe"),
        (lambda c: c["arms"].update(third=c["arms"]["left"]), "one or two arms"),
    ],
)
def test_mistakes_are_named(
    changed: Callable[[Callable[[dict[str, Any]], None]], Path],
    change: Callable[[dict[str, Any]], None],
    text: str,
) -> None:
    """What is missing, unknown or does not fit is refused with its name."""
    with pytest.raises(InvalidInputError, match=text):
        read_robot_file(changed(change))


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda c: c.update(gripper_law={"kind": "suction"}), "suction"),
        (lambda c: c.update(gripper_law={"kind": "sliding_fingers", "grip": 1}), "grip"),
        (lambda c: c.update(table={"colour": "red"}), "colour"),
        (lambda c: c.update(torso="head"), "torso of one joint"),
    ],
)
def test_unknown_figures_are_named(
    changed: Callable[[Callable[[dict[str, Any]], None]], Path],
    change: Callable[[dict[str, Any]], None],
    text: str,
) -> None:
    """Hands, tables and torsos that are not understood are refused."""
    with pytest.raises(InvalidInputError, match=text):
        load_description(changed(change))


def test_a_file_that_is_no_description_is_refused(tmp_path: Path) -> None:
    """No file, no YAML and no mapping each give one clear error."""
    path = tmp_path / "robot.yaml"
    with pytest.raises(InvalidInputError, match="robot.yaml"):
        read_robot_file(path)
    path.write_text("[1, 2")
    with pytest.raises(InvalidInputError, match="YAML"):
        read_robot_file(path)
    path.write_text("just words")
    with pytest.raises(InvalidInputError, match="keys and values"):
        read_robot_file(path)


@pytest.mark.parametrize("width", [0.0, 0.02, 0.08])
def test_sliding_fingers_there_and_back(width: float) -> None:
    """Joints for an opening give that opening again."""
    law = SlidingFingers((0.0, 0.0), (0.04, 0.04), 0.08)
    assert law.width_from_joints(law.joints_from_width(width)) == pytest.approx(width)


def test_sliding_fingers_refuse_what_they_cannot() -> None:
    """Openings out of range and figures without sense are refused."""
    law = SlidingFingers((0.0, 0.0), (0.04, 0.04), 0.08)
    with pytest.raises(InvalidInputError):
        law.joints_from_width(0.09)
    with pytest.raises(InvalidInputError):
        SlidingFingers((0.0,), (0.0,), 0.08)
    with pytest.raises(InvalidInputError):
        SlidingFingers((0.0,), (0.04,), 0.0)


def test_narrower_limits_must_fit(
    changed: Callable[[Callable[[dict[str, Any]], None]], Path],
) -> None:
    """Limits that leave nothing of the URDF's range are refused."""

    def change(content: dict[str, Any]) -> None:
        content["position_limits"]["LARM_JOINT3"] = [200, 210]
        content["urdf"] = str(HIRO.with_name("hiro.urdf"))

    with pytest.raises(InvalidInputError, match="LARM_JOINT3"):
        RobotModel(load_description(changed(change)))
