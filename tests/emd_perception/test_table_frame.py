"""Tests of the table frame."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from perception_scenes import head_camera_to_table
from scipy.spatial.transform import Rotation

from emd_core.errors import InvalidInputError
from emd_core.frames import inverse_transform, transform_points
from emd_perception.table_frame import (
    check_transform,
    plane_from_transform,
    refine_table_frame,
    table_frame_from_plane,
)
from emd_perception.table_plane import TablePlane


def moved(transform: np.ndarray, rotation_vector: list[float], height: float) -> np.ndarray:
    """Extrinsics that err by a rotation and a height."""
    error = np.eye(4)
    error[:3, :3] = Rotation.from_rotvec(rotation_vector).as_matrix()
    error[2, 3] = height
    return error @ transform


def points_on(plane: np.ndarray) -> np.ndarray:
    """Three points of a plane."""
    foot = -plane[3] * plane[:3]
    across = np.cross(plane[:3], [0.3, 1.0, 0.2])
    return np.array([foot, foot + across, foot + np.cross(plane[:3], across)])


@settings(max_examples=30, deadline=None)
@given(tilt_x=st.floats(-0.05, 0.05), tilt_y=st.floats(-0.05, 0.05), height=st.floats(-0.02, 0.02))
def test_refinement_lays_the_measured_plane_at_zero(tilt_x, tilt_y, height) -> None:
    """Whatever small error the extrinsics have, the measured table becomes z = 0."""
    truth = head_camera_to_table()
    plane = TablePlane(plane_from_transform(truth), 1.0)
    refined = refine_table_frame(moved(truth, [tilt_x, tilt_y, 0.0], height), plane)
    assert refined.agrees
    assert refined.offset == pytest.approx(height, abs=2e-3)
    on_table = transform_points(refined.transform_camera_to_table, points_on(plane.coefficients))
    np.testing.assert_allclose(on_table[:, 2], 0.0, atol=1e-9)
    check_transform(refined.transform_camera_to_table)


def test_exact_extrinsics_stay_as_they_are() -> None:
    """Nothing is corrected where plane and extrinsics agree."""
    truth = head_camera_to_table()
    refined = refine_table_frame(truth, TablePlane(plane_from_transform(truth), 1.0))
    np.testing.assert_allclose(refined.transform_camera_to_table, truth, atol=1e-12)
    assert refined.tilt == pytest.approx(0.0, abs=1e-7)


def test_refinement_keeps_the_origin_of_the_table() -> None:
    """What the extrinsics place at the origin stays over it, up to its height."""
    truth = head_camera_to_table()
    wrong = moved(truth, [0.04, -0.03, 0.0], 0.01)
    refined = refine_table_frame(wrong, TablePlane(plane_from_transform(truth), 1.0))
    origin_in_camera = inverse_transform(wrong)[:3, 3]
    now = transform_points(refined.transform_camera_to_table, origin_in_camera)
    assert np.linalg.norm(now[:2]) < 1e-3


@pytest.mark.parametrize(("tilt", "height"), [(0.2, 0.0), (0.0, 0.06)])
def test_a_plane_far_from_the_extrinsics_is_not_believed(tilt: float, height: float) -> None:
    """A large disagreement is reported, and the extrinsics stay."""
    truth = head_camera_to_table()
    wrong = moved(truth, [tilt, 0.0, 0.0], height)
    refined = refine_table_frame(wrong, TablePlane(plane_from_transform(truth), 1.0))
    assert not refined.agrees
    assert refined.tilt == pytest.approx(tilt, abs=1e-9)
    np.testing.assert_array_equal(refined.transform_camera_to_table, wrong)


def test_without_extrinsics_the_plane_gives_the_frame_of_the_conventions() -> None:
    """X runs down the picture, y to its right, z up; the origin lies where it was asked for."""
    truth = head_camera_to_table()
    plane = TablePlane(plane_from_transform(truth), 1.0)
    origin = inverse_transform(truth)[:3, 3] + 0.01 * plane.normal
    transform = table_frame_from_plane(plane, origin)
    np.testing.assert_allclose(transform, truth, atol=1e-9)


def test_a_camera_that_looks_along_the_table_is_refused() -> None:
    """Without a view down at the table no direction on it is "down the picture"."""
    plane = TablePlane(np.array([0.0, -1.0, 0.0, 0.5]), 1.0)
    with pytest.raises(InvalidInputError, match="looks along"):
        table_frame_from_plane(plane, np.zeros(3))


@pytest.mark.parametrize(
    "matrix",
    [
        np.eye(3),
        np.diag([1.0, 1.0, -1.0, 1.0]),
        np.diag([2.0, 2.0, 2.0, 1.0]),
        np.full((4, 4), np.nan),
    ],
)
def test_what_is_no_rigid_transform_is_refused(matrix) -> None:
    """Mirrors, scales, other shapes and NaN are no extrinsics."""
    with pytest.raises(InvalidInputError):
        check_transform(matrix)
