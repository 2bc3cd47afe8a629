"""The table before the robot and the camera above it."""

from __future__ import annotations

import numpy as np
import pytest

from emd_arm_executor.hiro.cell_geometry import (
    CellGeometry,
    transform_camera_to_table,
    transform_camera_to_waist,
)
from emd_arm_executor.hiro.description import OBSERVE
from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView, inverse_transform, transform_points
from emd_core.pinhole_camera import PinholeCamera


def test_table_frame_is_turned_round() -> None:
    """X of the table frame points to the robot, y to the right as the camera sees it, z up."""
    geometry = CellGeometry()
    transform = geometry.transform_table_to_waist
    assert transform[:3, :3] == pytest.approx(np.diag([-1.0, -1.0, 1.0]), abs=1e-12)
    assert transform @ geometry.transform_waist_to_table == pytest.approx(np.eye(4), abs=1e-12)


def test_observing_camera_looks_at_the_table_frames_origin() -> None:
    """In the observe posture the optical axis meets the origin within 1 mm."""
    transform = transform_camera_to_table(*OBSERVE.positions("head"))
    position, axis = transform[:3, 3], transform[:3, 2]
    hit = position - position[2] / axis[2] * axis
    assert np.linalg.norm(hit) < 1e-3


def test_picture_has_the_tables_axes() -> None:
    """In the picture, table x runs down and table y to the right."""
    transform = inverse_transform(transform_camera_to_table(*OBSERVE.positions("head")))
    points = np.array([[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]])
    pixels = PinholeCamera().project(transform_points(transform, points))
    assert pixels[1, 1] > pixels[0, 1] + 30
    assert pixels[2, 0] > pixels[0, 0] + 30


def test_field_of_view_lies_in_the_picture() -> None:
    """All eight corners of the network's box are projected into the image."""
    fov, camera = FieldOfView(), PinholeCamera()
    extent, top = fov.half_extent, fov.half_extent * fov.height
    corners = np.array(
        [[x, y, z] for x in (-extent, extent) for y in (-extent, extent) for z in (0.0, top)]
    )
    transform = inverse_transform(transform_camera_to_table(*OBSERVE.positions("head")))
    pixels = camera.project(transform_points(transform, corners))
    assert (pixels > 0).all()
    assert (pixels < (camera.width - 1, camera.height - 1)).all()


@pytest.mark.parametrize(("pan", "tilt"), [(0.0, 0.0), (0.4, 0.9), (-1.0, -0.2)])
def test_camera_pose_is_that_of_the_model(world, pan: float, tilt: float) -> None:
    """The closed form of the camera's pose equals PyBullet's forward kinematics."""
    world.set_joint_targets({"HEAD_JOINT0": pan, "HEAD_JOINT1": tilt})
    for _ in range(400):
        world.step()
    wanted = world.transform_link_to_waist("camera_optical_frame")
    assert transform_camera_to_waist(pan, tilt) == pytest.approx(wanted, abs=2e-4)


@pytest.mark.parametrize(
    "wrong",
    [
        {"table_origin_in_waist": (0.3, 0.0, float("nan"))},
        {"table_size": (0.7, 0.0, 0.03)},
        {"workspace_lower": (0.3, 0.0, 0.0)},
        {"table_origin_in_waist": (0.3, 0.0, -0.79)},
    ],
)
def test_impossible_geometry_is_refused(wrong) -> None:
    """NaN, flat tables, empty workspaces and tables below the floor raise."""
    with pytest.raises(InvalidInputError):
        CellGeometry(**wrong)
