"""Which columns of the grid hands and grippers in view hide from the camera."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from emd_core.frames import FieldOfView, FloatArray
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.config import VoxelConfig
from emd_perception.image_types import FloatImage, Mask
from emd_perception.unprojection import ray_parts

_HIDDEN, _SEEN = 1, 2  # kinds of pixels; 0: table that is seen


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
    which some cloth is seen beside a hand is known to hold cloth. Every fourth pixel is counted,
    which are ten or more of a column.

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
    counts = np.zeros((3, *field_of_view.size[:2]), dtype=np.int64)
    if hiding.any():
        rays = ray_parts(transform_camera_to_table[:3, :3], camera)
        position = transform_camera_to_table[:3, 3] + [*2 * [field_of_view.half_extent], 0.0]
        scale = (1.0 / field_of_view.resolution[:2]).astype(np.float32)
        what = hiding.astype(np.uint8) + np.uint8(_SEEN) * (cloth & ~hiding)
        _count_pixels(what, *rays, position.astype(np.float32), scale, counts)
    hidden, seen = counts[_HIDDEN], counts[_SEEN]
    return (hidden > settings.max_hidden_share * counts.sum(axis=0)) & (hidden > seen)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _count_pixels(
    what: NDArray[np.uint8],
    of_column: FloatImage,
    of_row: FloatImage,
    camera_from_corner: NDArray[np.float32],
    scale: NDArray[np.float32],
    counts: NDArray[np.int64],
) -> None:
    """Count every second pixel of every second row, by the column in which its ray ends."""
    x0, y0, height = camera_from_corner[0], camera_from_corner[1], camera_from_corner[2]
    end_x, end_y = np.float32(counts.shape[1]), np.float32(counts.shape[2])
    for row in range(0, what.shape[0], 2):
        along_x, along_y, up = of_row[0, row], of_row[1, row], of_row[2, row]
        for column in range(0, what.shape[1], 2):
            fall = -(of_column[2, column] + up)
            if fall <= 0.0:
                continue
            reach = height / fall
            x = (x0 + reach * (of_column[0, column] + along_x)) * scale[0]
            y = (y0 + reach * (of_column[1, column] + along_y)) * scale[1]
            if 0.0 <= x < end_x and 0.0 <= y < end_y:
                counts[what[row, column], np.int64(x), np.int64(y)] += 1
