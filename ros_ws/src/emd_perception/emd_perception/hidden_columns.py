"""Which columns of the grid hands and grippers in view hide from the camera."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from emd_core.frames import FieldOfView, FloatArray
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.config import VoxelConfig
from emd_perception.image_types import Mask
from emd_perception.unprojection import ray_parts


def hidden_columns(
    hiding: Mask,
    cloth: Mask,
    camera: PinholeCamera,
    transform_camera_to_table: FloatArray,
    field_of_view: FieldOfView,
    config: VoxelConfig | None = None,
) -> NDArray[np.bool_]:
    """Find the columns of which it cannot be said whether they hold cloth.

    A pixel of a hand hides the place on the table that its ray would have met. A column is hidden
    if more than a small share of its pixels is, and more of them than show cloth: a column of
    which some cloth is seen beside a hand is known to hold cloth.

    Args:
        hiding: Pixels of what stands before the table and the cloth, shape (H, W).
        cloth: The cloth's pixels, shape (H, W).
        camera: The camera of both.
        transform_camera_to_table: Shape (4, 4), metres.
        field_of_view: Box and columns.
        config: Share that counts; the defaults if None.

    Returns:
        Shape (X, Y).
    """
    settings = config or VoxelConfig()
    shape = field_of_view.size[:2]
    counts = np.zeros((3, *shape), dtype=np.int64)
    if hiding.any():
        of_column, of_row = ray_parts(transform_camera_to_table[:3, :3], camera)
        resolution = field_of_view.resolution[:2].copy()
        origin = transform_camera_to_table[:3, 3].astype(np.float64)
        corner = origin[:2] + field_of_view.half_extent
        what = hiding.astype(np.uint8) + 2 * (cloth & ~hiding).astype(np.uint8)
        _count_pixels(what, of_column, of_row, corner, origin[2], resolution, counts)
    free, hidden, seen = counts
    return (hidden > settings.max_hidden_share * (free + hidden + seen)) & (hidden > seen)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _count_pixels(
    what: NDArray[np.uint8],
    of_column: FloatArray,
    of_row: FloatArray,
    camera_from_corner: FloatArray,
    camera_height: float,
    resolution: FloatArray,
    counts: NDArray[np.int64],
) -> None:
    """Count the pixels of each kind, by the column in which their rays meet the table."""
    for row in range(what.shape[0]):
        for column in range(what.shape[1]):
            up = of_column[2, column] + of_row[2, row]
            if up >= 0.0:
                continue
            reach = -camera_height / up
            x = camera_from_corner[0] + reach * (of_column[0, column] + of_row[0, row])
            y = camera_from_corner[1] + reach * (of_column[1, column] + of_row[1, row])
            i, j = np.floor(x / resolution[0]), np.floor(y / resolution[1])
            if 0 <= i < counts.shape[1] and 0 <= j < counts.shape[2]:
                counts[what[row, column], np.int64(i), np.int64(j)] += 1
