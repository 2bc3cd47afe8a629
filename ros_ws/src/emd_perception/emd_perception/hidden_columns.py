"""Which columns of the grid hands and grippers in view hide from the camera."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from emd_core.frames import FieldOfView, FloatArray, transform_points
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.config import VoxelConfig
from emd_perception.image_types import FloatImage, Mask
from emd_perception.mask_morphology import bounding_window
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
    counts = np.zeros((3, *field_of_view.size[:2]), dtype=np.int64)
    if hiding.any():
        rays = ray_parts(transform_camera_to_table[:3, :3], camera)
        position = transform_camera_to_table[:3, 3] + [*2 * [field_of_view.half_extent], 0.0]
        scale = 1.0 / field_of_view.resolution[:2]
        what = hiding.astype(np.uint8) + 2 * (cloth & ~hiding).astype(np.uint8)
        parts = (what, *rays, position.astype(np.float32), scale.astype(np.float32), counts)
        _count_pixels(*_bounds(bounding_window(hiding, 0)), *parts)
        window = _window_of(counts[_HIDDEN] > 0, camera, transform_camera_to_table, field_of_view)
        counts[:] = 0
        _count_pixels(*_bounds(window), *parts)
    hidden, seen = counts[_HIDDEN], counts[_SEEN]
    return (hidden > settings.max_hidden_share * counts.sum(axis=0)) & (hidden > seen)


def _window_of(
    columns: Mask,
    camera: PinholeCamera,
    transform_camera_to_table: FloatArray,
    field_of_view: FieldOfView,
) -> tuple[slice, slice]:
    """Rows and columns of the picture in which all of the given columns of the grid lie.

    Only there pixels need be counted; all of the picture if a corner lies behind the camera.
    """
    x, y = bounding_window(columns, 0)
    ends = np.array([[x.start, x.stop], [y.start, y.stop]]) * field_of_view.resolution[:2, None]
    xs, ys = (one.ravel() for one in np.meshgrid(*(ends - field_of_view.half_extent)))
    to_camera = np.linalg.inv(transform_camera_to_table)
    corners = transform_points(to_camera, np.stack([xs, ys, np.zeros(4)], axis=-1))
    if corners[:, 2].min() <= 0.0:
        return slice(0, camera.height), slice(0, camera.width)
    pixels = camera.project(corners)
    limit = np.array([camera.width, camera.height])
    first = np.clip(np.floor(pixels.min(axis=0)), 0, limit).astype(int)
    last = np.clip(np.ceil(pixels.max(axis=0)) + 1, 0, limit).astype(int)
    return slice(first[1], last[1]), slice(first[0], last[0])


def _bounds(window: tuple[slice, slice]) -> tuple[int, int, int, int]:
    """First row, row after the last, first column, column after the last."""
    rows, columns = window
    return rows.start, rows.stop, columns.start, columns.stop


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _count_pixels(
    first_row: int,
    end_row: int,
    first_column: int,
    end_column: int,
    what: NDArray[np.uint8],
    of_column: FloatImage,
    of_row: FloatImage,
    camera_from_corner: NDArray[np.float32],
    scale: NDArray[np.float32],
    counts: NDArray[np.int64],
) -> None:
    """Count the pixels of each kind, by the column in which their rays meet the table."""
    for row in range(first_row, min(end_row, what.shape[0])):
        for column in range(first_column, min(end_column, what.shape[1])):
            up = of_column[2, column] + of_row[2, row]
            if up >= 0.0:
                continue
            reach = -camera_from_corner[2] / up
            x = camera_from_corner[0] + reach * (of_column[0, column] + of_row[0, row])
            y = camera_from_corner[1] + reach * (of_column[1, column] + of_row[1, row])
            i, j = np.floor(x * scale[0]), np.floor(y * scale[1])
            if 0 <= i < counts.shape[1] and 0 <= j < counts.shape[2]:
                counts[what[row, column], np.int64(i), np.int64(j)] += 1
