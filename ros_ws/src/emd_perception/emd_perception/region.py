"""Where in the picture the cloth may be, and how large a pixel is on the table there."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from emd_core.frames import FieldOfView, FloatArray
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.image_types import DepthImage, FloatImage, Mask
from emd_perception.mask_morphology import convex_hull, opened
from emd_perception.table_plane import TablePlane
from emd_perception.unprojection import ray_parts

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
    of_column, of_row = ray_parts(transform_camera_to_table[:3, :3], camera)
    camera_in_table = transform_camera_to_table[:3, 3].astype(np.float32)
    half = np.float32(field_of_view.half_extent * (1.0 + margin))
    region = np.empty((camera.height, camera.width), dtype=np.bool_)
    _mark_within(of_column, of_row, camera_in_table, half, region)
    return region


def pixel_area_on_table(camera: PinholeCamera, plane: TablePlane) -> FloatImage:
    """Area of the table that each pixel covers, shape (H, W), square metres.

    At distance z along the optical axis a pixel covers z^2 / (fx fy) across the axis, and on the
    table 1 / slope as much, where slope is the ray's (z = 1) component along the table's normal.
    """
    across = plane.coefficients[3] ** 2 / (camera.fx * camera.fy)
    area = np.empty((camera.height, camera.width), dtype=np.float32)
    _fill_areas(*ray_parts(plane.normal, camera), np.float32(across), area)
    return area


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _mark_within(
    of_column: FloatArray,
    of_row: FloatArray,
    camera_in_table: NDArray[np.float32],
    half: np.float32,
    region: Mask,
) -> None:
    """Mark pixels whose ray falls to the table within `half` of its origin along x and y."""
    steepest = np.float32(-1e-9)
    for row in range(region.shape[0]):
        for column in range(region.shape[1]):
            up = np.float32(of_column[2, column] + of_row[2, row])
            reach = -camera_in_table[2] / min(up, steepest)
            x = np.float32(of_column[0, column] + of_row[0, row]) * reach + camera_in_table[0]
            y = np.float32(of_column[1, column] + of_row[1, row]) * reach + camera_in_table[1]
            region[row, column] = (up < 0) & (abs(x) <= half) & (abs(y) <= half)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _fill_areas(
    of_column: FloatArray, of_row: FloatArray, across: np.float32, area: FloatImage
) -> None:
    for row in range(area.shape[0]):
        for column in range(area.shape[1]):
            slope = max(-np.float32(of_column[column] + of_row[row]), np.float32(_LEAST_SLOPE))
            area[row, column] = across / (slope * slope * slope)
