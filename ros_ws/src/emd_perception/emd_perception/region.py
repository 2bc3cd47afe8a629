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
    region = convex_hull(opened(height >= _BELOW_TABLE, _SPECK))
    below = height < _BELOW_TABLE
    if below.any():
        region &= ~opened(below, _SPECK)
    return region


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
    of_column: FloatImage,
    of_row: FloatImage,
    camera_in_table: NDArray[np.float32],
    half: np.float32,
    region: Mask,
) -> None:
    """Mark pixels whose ray falls to the table within `half` of its origin along x and y.

    A ray that falls by `fall` a metre meets the table after height / fall metres. Both sides of
    the comparison are multiplied by `fall`, for a division takes several times as long; they
    never agree for rays that rise.
    """
    x0, y0, height = camera_in_table[0], camera_in_table[1], camera_in_table[2]
    for row in range(region.shape[0]):
        along_x, along_y, up = of_row[0, row], of_row[1, row], of_row[2, row]
        for column in range(region.shape[1]):
            fall = -(of_column[2, column] + up)
            x = (of_column[0, column] + along_x) * height + x0 * fall
            y = (of_column[1, column] + along_y) * height + y0 * fall
            region[row, column] = (abs(x) <= half * fall) & (abs(y) <= half * fall)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _fill_areas(
    of_column: FloatImage, of_row: FloatImage, across: np.float32, area: FloatImage
) -> None:
    for row in range(area.shape[0]):
        own = of_row[row]
        for column in range(area.shape[1]):
            slope = max(-(of_column[column] + own), np.float32(_LEAST_SLOPE))
            area[row, column] = across / (slope * slope * slope)
