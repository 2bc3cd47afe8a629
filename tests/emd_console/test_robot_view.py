"""The robot's shapes and where they are."""

import numpy as np
import pytest

from emd_arm_executor.hiro.description import (
    OBSERVE,
    URDF_PATH,
    CellGeometry,
    transform_camera_to_waist,
)
from emd_console.robot_view import RobotView
from emd_core.errors import InvalidInputError


@pytest.fixture(scope="module")
def view() -> RobotView:
    """HIRO."""
    return RobotView(URDF_PATH.read_text())


def test_every_visual_has_a_pose(view) -> None:
    """One row a shape: position and unit quaternion."""
    poses = view.poses(OBSERVE.by_joint())
    assert len(poses) == len(view.shapes) > 40
    assert np.allclose(np.linalg.norm(poses[:, 3:], axis=1), 1.0, atol=1e-5)


def test_only_the_arm_that_moves_moves(view) -> None:
    """A left joint leaves the right arm's shapes where they were."""
    rest = OBSERVE.by_joint()
    moved = {**rest, "LARM_JOINT0": rest["LARM_JOINT0"] + 0.3}
    change = np.abs(view.poses(moved) - view.poses(rest)).max(axis=1)
    assert 5 < (change > 1e-4).sum() < len(change) / 2


def test_the_camera_is_where_the_cell_says(view) -> None:
    """Forward kinematics of the description agree with the cell's geometry."""
    rest = {**OBSERVE.by_joint(), "CHEST_JOINT0": 0.0}
    wanted = transform_camera_to_waist(rest["HEAD_JOINT0"], rest["HEAD_JOINT1"])
    found = view.transform_to_base("camera_optical_frame", rest)
    assert found is not None and np.allclose(found, wanted, atol=1e-6)
    assert CellGeometry().floor_height < found[2, 3]


def test_unknown_joints_and_frames_are_no_error(view) -> None:
    """Another robot may say more than its description."""
    view.poses({"no_such_joint": 1.0, "LARM_JOINT0": float("nan")})
    assert view.transform_to_base("no_such_frame", {}) is None


@pytest.mark.parametrize("text", ["", "no xml", "<robot/>", "x" * 2_000_001])
def test_what_is_no_description_is_refused(text) -> None:
    """In a sentence, not a crash."""
    with pytest.raises(InvalidInputError, match="robot_description"):
        RobotView(text)
