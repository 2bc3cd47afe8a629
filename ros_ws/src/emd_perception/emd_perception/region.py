"""Where in the picture the cloth may be, and how large a pixel is on the table there."""

from __future__ import annotations

import numpy as np

from emd_core.frames import FieldOfView, FloatArray
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.image_types import DepthImage, FloatImage, Mask
from emd_perception.mask_morphology import convex_hull, opened
from emd_perception.table_plane import TablePlane
from emd_perception.unprojection import along_rays

_BELOW_TABLE = -0.03  # metres; lower is the floor beside the table
_LEAST_SLOPE = 0.1  # flatter views of the table count as this flat
_SPECK = 5  # pixels; smaller patches of depth are noise


def observed_region(height: DepthImage) -> Mask:
    """Convex hull of what has a depth, without what lies below the table.

    Cloth may lack depth in places (black fabric swallows infrared light), so holes stay in; what
    lies beyond every measured point (walls out of range) cannot become a voxel and stays out.

    Args:
        height: Height above the table, shape (H, W), metres, NaN where the depth is unknown.
    """
    below = height < _BELOW_TABLE
    return convex_hull(opened(np.isfinite(height) & ~below, _SPECK)) & ~opened(below, _SPECK)


def field_of_view_region(
    camera: PinholeCamera,
    transform_camera_to_table: FloatArray,
    field_of_view: FieldOfView,
    margin: float,
) -> Mask:
    """Pixels whose ray meets the table within the field of view, enlarged by a share `margin`."""
    camera_in_table = transform_camera_to_table[:3, 3]
    x, y, up = (along_rays(axis, camera) for axis in transform_camera_to_table[:3, :3])
    reach = np.float32(-camera_in_table[2]) / np.minimum(up, np.float32(-1e-9))
    half = np.float32(field_of_view.half_extent * (1.0 + margin))
    within_x = np.abs(x * reach + np.float32(camera_in_table[0])) <= half
    within_y = np.abs(y * reach + np.float32(camera_in_table[1])) <= half
    return np.asarray(within_x & within_y & (up < 0))


def pixel_area_on_table(camera: PinholeCamera, plane: TablePlane) -> FloatImage:
    """Area of the table that each pixel covers, shape (H, W), square metres.

    At distance z along the optical axis a pixel covers z^2 / (fx fy) across the axis, and on the
    table 1 / slope as much, where slope is the ray's (z = 1) component along the table's normal.
    """
    slope = np.maximum(-along_rays(plane.normal, camera), np.float32(_LEAST_SLOPE))
    across = plane.coefficients[3] ** 2 / (camera.fx * camera.fy)
    return np.asarray(np.float32(across) / (slope * slope * slope))
