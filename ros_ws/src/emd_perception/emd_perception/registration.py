"""Depth measured anywhere, as the colour camera would measure it.

OpenCV's registerDepth and Open3D's projection move single points: they leave holes where the
colour image is finer, and the former's dilation brings a tilted table a millimetre nearer. Here
neighbouring points span a surface, which is drawn with a depth buffer.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.image_types import DepthImage

# Neighbours whose depths differ by more than this share belong to different things.
_MAX_JUMP = 0.03
_CELL = 1.5  # mean points in a cell: its square
_NEAREST = 0.05  # metres; nearer points project nowhere sensible


def draw_depth(
    points: NDArray[np.floating], camera: PinholeCamera, transform_points_to_camera: FloatArray
) -> DepthImage:
    """Draw a grid of points as the surface that they span.

    Args:
        points: Shape (H, W, 3), metres, neighbours in space where they are in the array; NaN
            where unknown.
        camera: Of the depth image wanted; without distortion.
        transform_points_to_camera: Shape (4, 4).

    Returns:
        Shape (camera.height, camera.width), metres along the optical axis, NaN where no point is
        near or another one hides it.

    Raises:
        InvalidInputError: If the points have another shape.
    """
    if points.ndim != 3 or points.shape[2] != 3:
        raise InvalidInputError(f"points of shape (H, W, 3) are needed, got {points.shape}")
    transform = np.ascontiguousarray(transform_points_to_camera, dtype=np.float64)
    intrinsics = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    projected = np.empty(points.shape, dtype=np.float64)
    _project(np.ascontiguousarray(points, dtype=np.float64), transform, intrinsics, projected)
    inverse = np.zeros((camera.height, camera.width))
    _draw_surface(projected, inverse)
    _draw_points(projected, inverse)
    depth = np.full(inverse.shape, np.nan, dtype=np.float32)
    seen = inverse > 0
    depth[seen] = 1.0 / inverse[seen]
    return depth


def arrange_points(
    points: FloatArray, camera: PinholeCamera, transform_points_to_camera: FloatArray
) -> FloatArray:
    """Lay points without order out in a grid, by where the camera sees them.

    The grid is as fine as there are points for. A cell gets the mean of the points of its nearest
    thing: the nearest point alone would be the one whose noise brings it nearest.

    Args:
        points: Shape (N, 3), metres; rows with NaN are left out.
        camera: Which looks at them; without distortion.
        transform_points_to_camera: Shape (4, 4).

    Returns:
        Shape (rows, columns, 3), metres, NaN where a cell is empty; in the points' own frame.
    """
    known = points[np.isfinite(points).all(axis=1)]
    in_camera = known @ transform_points_to_camera[:3, :3].T + transform_points_to_camera[:3, 3]
    before = in_camera[:, 2] > _NEAREST
    pixels = camera.project(in_camera[before])
    size = np.array([camera.width, camera.height])
    seen = ((pixels >= -0.5) & (pixels < size - 0.5)).all(axis=1)
    if not seen.any():
        return np.full((1, 1, 3), np.nan)
    share = camera.width * camera.height / int(seen.sum())
    # Points that lie at random leave a ninth of such cells empty, those of a picture none.
    cell = max(1.0, _CELL * math.sqrt(share))
    chosen, depth = known[before][seen], in_camera[before][seen, 2]
    index = ((pixels[seen] + 0.5) / cell).astype(int)
    columns, rows = np.ceil(size / cell).astype(int)
    flat = index[:, 1] * columns + index[:, 0]
    nearest = np.full(rows * columns, np.inf)
    np.minimum.at(nearest, flat, depth)
    of_nearest = depth <= (1.0 + _MAX_JUMP) * nearest[flat]
    flat, chosen = flat[of_nearest], chosen[of_nearest]
    counts = np.bincount(flat, minlength=rows * columns)
    totals = [np.bincount(flat, weights=axis, minlength=rows * columns) for axis in chosen.T]
    with np.errstate(invalid="ignore"):  # empty cells become NaN
        return np.asarray(np.stack(totals, axis=-1) / counts[:, None]).reshape(rows, columns, 3)


@numba.njit(cache=True, error_model="numpy")
def _project(
    points: FloatArray, transform: FloatArray, intrinsics: FloatArray, projected: FloatArray
) -> None:
    """Give column, row and 1 / z of each point; 1 / z = 0 where it is unknown or behind."""
    fx, fy, cx, cy = intrinsics
    for i in range(points.shape[0]):
        for j in range(points.shape[1]):
            x, y, z = points[i, j]
            zc = transform[2, 0] * x + transform[2, 1] * y + transform[2, 2] * z + transform[2, 3]
            projected[i, j] = 0.0
            if not zc > _NEAREST or not zc < 1e6:  # a comparison with NaN is false
                continue
            xc = transform[0, 0] * x + transform[0, 1] * y + transform[0, 2] * z + transform[0, 3]
            yc = transform[1, 0] * x + transform[1, 1] * y + transform[1, 2] * z + transform[1, 3]
            column, row = fx * xc / zc + cx, fy * yc / zc + cy
            if abs(column) < 1e6 and abs(row) < 1e6:
                projected[i, j, 0], projected[i, j, 1] = column, row
                projected[i, j, 2] = 1.0 / zc


@numba.njit(cache=True, error_model="numpy")
def _draw_surface(projected: FloatArray, inverse: FloatArray) -> None:
    """Draw two triangles between each four neighbours, or one where one of them is unknown."""
    for i in range(projected.shape[0] - 1):
        for j in range(projected.shape[1] - 1):
            along_first = projected[i, j, 2] > 0.0 and projected[i + 1, j + 1, 2] > 0.0
            if projected[i, j + 1, 2] > 0.0 and projected[i + 1, j, 2] > 0.0:
                _draw_triangle(projected, i, j, i, j + 1, i + 1, j, inverse)
                _draw_triangle(projected, i + 1, j + 1, i + 1, j, i, j + 1, inverse)
            elif along_first:
                _draw_triangle(projected, i, j, i, j + 1, i + 1, j + 1, inverse)
                _draw_triangle(projected, i, j, i + 1, j + 1, i + 1, j, inverse)


@numba.njit(cache=True, error_model="numpy")
def _draw_triangle(
    projected: FloatArray,
    ai: int,
    aj: int,
    bi: int,
    bj: int,
    ci: int,
    cj: int,
    inverse: FloatArray,
) -> None:
    """Keep the greatest 1 / z, which is linear in the picture, of the pixels inside."""
    az, bz, cz = projected[ai, aj, 2], projected[bi, bj, 2], projected[ci, cj, 2]
    farthest = min(az, bz, cz)
    if not farthest > 0.0 or max(az, bz, cz) > farthest * (1.0 + _MAX_JUMP):
        return
    ax, ay = projected[ai, aj, 0], projected[ai, aj, 1]
    bx, by = projected[bi, bj, 0] - ax, projected[bi, bj, 1] - ay
    cx, cy = projected[ci, cj, 0] - ax, projected[ci, cj, 1] - ay
    twice_area = bx * cy - by * cx
    if abs(twice_area) < 1e-9:
        return
    height, width = inverse.shape
    first_column = max(0, int(np.ceil(ax + min(0.0, bx, cx) - 1e-6)))
    last_column = min(width - 1, int(np.floor(ax + max(0.0, bx, cx) + 1e-6)))
    first_row = max(0, int(np.ceil(ay + min(0.0, by, cy) - 1e-6)))
    last_row = min(height - 1, int(np.floor(ay + max(0.0, by, cy) + 1e-6)))
    for row in range(first_row, last_row + 1):
        for column in range(first_column, last_column + 1):
            x, y = column - ax, row - ay
            weight_b = (x * cy - y * cx) / twice_area
            weight_c = (y * bx - x * by) / twice_area
            if weight_b >= -1e-6 and weight_c >= -1e-6 and weight_b + weight_c <= 1.0 + 1e-6:
                value = az + weight_b * (bz - az) + weight_c * (cz - az)
                inverse[row, column] = max(inverse[row, column], value)


@numba.njit(cache=True, error_model="numpy")
def _draw_points(projected: FloatArray, inverse: FloatArray) -> None:
    """Put points without a surface, at rims and between gaps, where nothing is yet."""
    height, width = inverse.shape
    surface = inverse > 0.0
    for i in range(projected.shape[0]):
        for j in range(projected.shape[1]):
            column, row = int(np.rint(projected[i, j, 0])), int(np.rint(projected[i, j, 1]))
            inside = 0 <= row < height and 0 <= column < width
            if inside and not surface[row, column]:
                inverse[row, column] = max(inverse[row, column], projected[i, j, 2])
