"""From the table to the picture and back."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from emd_arm_executor.hiro.description import OBSERVE, transform_camera_to_table
from emd_console.projection import TableProjection
from emd_core.errors import InvalidInputError
from emd_core.pinhole_camera import PinholeCamera

HEAD = OBSERVE.by_joint()


def cell_projection() -> TableProjection:
    """HIRO's head camera at its observing posture."""
    pose = transform_camera_to_table(HEAD["HEAD_JOINT0"], HEAD["HEAD_JOINT1"])
    return TableProjection(PinholeCamera(), pose)


@given(st.tuples(st.floats(-0.25, 0.25), st.floats(-0.25, 0.25)), st.floats(0.0, 0.1))
def test_a_point_on_the_table_is_found_again_there_and_back(point, height) -> None:
    """Projecting and casting the ray are inverse, at any height of the plane."""
    projection = cell_projection()
    pixel = projection.pixels(np.array([[*point, height]]))
    assert np.allclose(projection.table_points(pixel, height)[0], point, atol=1e-9)


def test_axes_are_those_of_the_picture() -> None:
    """The table's x runs down the picture and y to the right (docs/conventions.md)."""
    centre, down, right = cell_projection().pixels(
        np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]], dtype=float)
    )
    assert down[1] > centre[1] + 20 and abs(down[0] - centre[0]) < 20
    assert right[0] > centre[0] + 20 and abs(right[1] - centre[1]) < 20


def test_what_lies_behind_the_camera_has_no_pixel() -> None:
    """It must not appear mirrored in the picture."""
    projection = cell_projection()
    behind = projection.transform_camera_to_table @ [0, 0, -0.5, 1]
    assert np.isnan(projection.pixels(behind[None, :3])).all()


@pytest.mark.parametrize("pixel", [(-5.0, 10.0), (640.0, 10.0), (np.nan, 3.0), (1.0, 1e9)])
def test_a_pixel_outside_the_picture_is_refused(pixel) -> None:
    """The error names the picture's size."""
    with pytest.raises(InvalidInputError, match="640 x 480"):
        cell_projection().table_points(np.array([pixel]))


def test_a_ray_above_the_horizon_is_refused() -> None:
    """A level camera's upper half sees no table."""
    level = np.eye(4)
    level[:3, :3] = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]
    level[2, 3] = 0.5
    with pytest.raises(InvalidInputError, match="horizon"):
        TableProjection(PinholeCamera(), level).table_points(np.array([[320.0, 100.0]]))
