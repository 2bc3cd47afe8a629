"""Tests of the region of interest and of pixel areas: against the rays themselves."""

import cv2
import numpy as np
from perception_scenes import head_camera_to_table

from emd_core.frames import FieldOfView, transform_points
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.mask_morphology import convex_hull
from emd_perception.region import field_of_view_region, pixel_area_on_table
from emd_perception.table_plane import TablePlane
from emd_perception.unprojection import pixel_rays

CAMERA = PinholeCamera(160, 120, 131.0, 131.0, 79.5, 59.5)


def test_the_field_of_view_is_where_rays_meet_the_table_within_it() -> None:
    """Against the meeting points of all rays, those at the very border apart."""
    pose = head_camera_to_table()
    rays = pixel_rays(CAMERA) @ pose[:3, :3].T
    reach = -pose[2, 3] / rays[..., 2]
    x, y = (pose[axis, 3] + reach * rays[..., axis] for axis in (0, 1))
    farthest = np.where(reach > 0, np.maximum(np.abs(x), np.abs(y)), np.inf)
    limit = 1.2 * FieldOfView().half_extent
    found = field_of_view_region(CAMERA, pose, FieldOfView(), 0.2)
    clear = np.abs(farthest - limit) > 1e-5
    np.testing.assert_array_equal(found[clear], (farthest <= limit)[clear])
    assert 0.1 < found.mean() < 0.9


def test_a_pixels_area_is_that_of_the_quadrangle_on_the_table() -> None:
    """Corners of single pixels, carried to the table along their rays, span that area."""
    pose = head_camera_to_table()
    areas = pixel_area_on_table(CAMERA, TablePlane(pose[2].copy(), 1.0))
    for row, column in ((20, 30), (60, 80), (110, 150)):
        corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]) + [column, row]
        rays = np.column_stack(
            [(corners - [CAMERA.cx, CAMERA.cy]) / [CAMERA.fx, CAMERA.fy], np.ones(4)]
        )
        rays *= (-pose[2, 3] / (rays @ pose[2, :3]))[:, None]
        on_table = transform_points(pose, rays)[:, :2].astype(np.float32)
        np.testing.assert_allclose(areas[row, column], cv2.contourArea(on_table), rtol=2e-3)


def test_a_convex_hull_holds_its_mask_and_no_more_than_needed() -> None:
    """The hull of scattered pixels is the polygon that OpenCV makes of all of them."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        mask = np.zeros((40, 60), bool)
        rows, columns = rng.integers(3, 37, 12), rng.integers(5, 55, 12)
        mask[rows, columns] = True
        whole = np.zeros(mask.shape, np.uint8)
        cv2.fillConvexPoly(whole, cv2.convexHull(cv2.findNonZero(mask.astype(np.uint8))), (1,))
        np.testing.assert_array_equal(convex_hull(mask), whole.astype(bool))
    assert not convex_hull(np.zeros((9, 9), bool)).any()
