"""Z-buffer rasterisation in numba.

Every projection gives a vertex a column, a row and a key that is linear over the picture and
larger the nearer the point: 1 / depth for a pinhole camera, minus the depth for parallel light.
Pixel centres lie at whole numbers.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from emd_core.frames import FloatArray

KeyImage = NDArray[np.float64]
IndexImage = NDArray[np.int32]


@numba.njit(cache=True, nogil=True)
def _fill(
    corners: FloatArray, index: int, culled: bool, keys: KeyImage, indices: IndexImage
) -> None:
    """Draw one triangle of corners (3, 3): column, row, key; a back face only if not culled."""
    x0, y0, k0 = corners[0, 0], corners[0, 1], corners[0, 2]
    x1, y1, k1 = corners[1, 0], corners[1, 1], corners[1, 2]
    x2, y2, k2 = corners[2, 0], corners[2, 1], corners[2, 2]
    area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    # Rows grow downwards, so that a front face has a negative area.
    if area == 0.0 or (culled and area > 0.0):
        return
    height, width = keys.shape
    first_row = max(int(np.ceil(min(y0, y1, y2))), 0)
    last_row = min(int(np.floor(max(y0, y1, y2))), height - 1)
    key_dx = ((k1 - k0) * (y2 - y0) - (k2 - k0) * (y1 - y0)) / area
    key_dy = ((k2 - k0) * (x1 - x0) - (k1 - k0) * (x2 - x0)) / area
    for row in range(first_row, last_row + 1):
        left, right = -1e9, 1e9
        for edge in range(3):
            ax, ay = corners[edge, 0], corners[edge, 1]
            bx, by = corners[(edge + 1) % 3, 0], corners[(edge + 1) % 3, 1]
            # (b - a) x (p - a) has the sign of the area inside: slope * column <= bound.
            slope, bound = by - ay, (bx - ax) * (row - ay) + (by - ay) * ax
            if area < 0.0:
                slope, bound = -slope, -bound
            if slope > 0.0:
                right = min(right, bound / slope)
            elif slope < 0.0:
                left = max(left, bound / slope)
            elif bound < 0.0:
                right = -1e9
        # A hair's breadth more on both sides: neighbours must not leave gaps by rounding.
        first = max(int(np.ceil(left - 1e-9)), 0)
        last = min(int(np.floor(right + 1e-9)), width - 1)
        key = k0 + (first - x0) * key_dx + (row - y0) * key_dy
        for column in range(first, last + 1):
            if key > keys[row, column]:
                keys[row, column] = key
                indices[row, column] = index
            key += key_dx


@numba.njit(cache=True, nogil=True)
def draw_perspective(
    vertices: FloatArray,
    triangles: NDArray[np.int32],
    intrinsics: FloatArray,
    near: float,
    keys: KeyImage,
    indices: IndexImage,
) -> None:
    """Draw front faces as a pinhole camera sees them; keys are 1 / depth.

    Args:
        vertices: In the optical frame, shape (V, 3), metres.
        triangles: Shape (T, 3).
        intrinsics: fx, fy, cx, cy, pixels.
        near: Depth of the near plane, metres; what is nearer is cut off.
        keys: Shape (H, W), begins at 0.
        indices: Triangle seen, shape (H, W), begins at -1.
    """
    fx, fy, cx, cy = intrinsics
    clipped = np.empty((4, 3))
    corners = np.empty((3, 3))
    for index in range(len(triangles)):
        count = _clip_near(vertices, triangles[index], near, clipped)
        for corner in range(count):
            key = 1.0 / clipped[corner, 2]
            clipped[corner, 0] = fx * clipped[corner, 0] * key + cx
            clipped[corner, 1] = fy * clipped[corner, 1] * key + cy
            clipped[corner, 2] = key
        for fan in range(1, count - 1):
            corners[0] = clipped[0]
            corners[1] = clipped[fan]
            corners[2] = clipped[fan + 1]
            _fill(corners, index, True, keys, indices)


@numba.njit(cache=True, nogil=True)
def _clip_near(
    vertices: FloatArray, triangle: NDArray[np.int32], near: float, clipped: FloatArray
) -> int:
    """Cut a triangle at the near plane; returns 0, 3 or 4 corners left in `clipped` (4, 3)."""
    count = 0
    for corner in range(3):
        here, there = triangle[corner], triangle[(corner + 1) % 3]
        z_here, z_there = vertices[here, 2], vertices[there, 2]
        if z_here >= near:
            clipped[count] = vertices[here]
            count += 1
        if (z_here >= near) != (z_there >= near):
            share = (near - z_here) / (z_there - z_here)
            for axis in range(3):
                step = vertices[there, axis] - vertices[here, axis]
                clipped[count, axis] = vertices[here, axis] + share * step
            count += 1
    return count


@numba.njit(cache=True, nogil=True)
def draw_parallel(
    vertices: FloatArray, triangles: NDArray[np.int32], keys: KeyImage, indices: IndexImage
) -> None:
    """Draw all faces in parallel projection.

    Args:
        vertices: Column, row and key of the vertices, shape (V, 3).
        triangles: Shape (T, 3).
        keys: Shape (H, W), begins at minus infinity.
        indices: Triangle seen, shape (H, W), begins at -1.
    """
    corners = np.empty((3, 3))
    for index in range(len(triangles)):
        for corner in range(3):
            corners[corner] = vertices[triangles[index, corner]]
        _fill(corners, index, False, keys, indices)
