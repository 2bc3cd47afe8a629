"""From depth to 3D points in the camera optical frame (x right, y down, z forward)."""

from __future__ import annotations

from functools import lru_cache

import numba
import numpy as np
from numpy.typing import NDArray

from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.image_types import DepthImage, FloatImage, Mask


def pixel_rays(camera: PinholeCamera) -> FloatArray:
    """Direction of each pixel in the camera optical frame with z = 1, shape (H, W, 3)."""
    return camera.unproject(np.ones((camera.height, camera.width)))


def along_rays(direction: FloatArray, camera: PinholeCamera) -> FloatImage:
    """Component of each pixel's ray (z = 1) along a direction, shape (H, W), float32.

    Args:
        direction: Shape (3,), camera optical frame.
        camera: The camera of the pixels.
    """
    along = np.empty((camera.height, camera.width), dtype=np.float32)
    _add_parts(*ray_parts(direction, camera), along)
    return along


def ray_parts(directions: FloatArray, camera: PinholeCamera) -> tuple[FloatImage, FloatImage]:
    """Split the components of the pixels' rays (z = 1) along directions, so that none is built.

    Args:
        directions: Shape (..., 3), camera optical frame.
        camera: The camera of the pixels.

    Returns:
        A part for each column, shape (..., W), and one for each row, shape (..., H), float32; a
        ray's component is the sum of its two.
    """
    a, b, c = (directions[..., axis, None] for axis in range(3))
    x, y = _slopes(camera)
    return (a * x + c).astype(np.float32), (b * y).astype(np.float32)


@lru_cache(maxsize=4)
def _slopes(camera: PinholeCamera) -> tuple[FloatArray, FloatArray]:
    """Directions x / z of the columns' rays, shape (W,), and y / z of the rows', shape (H,)."""
    x = (np.arange(camera.width, dtype=np.float64) - camera.cx) / camera.fx
    y = (np.arange(camera.height, dtype=np.float64) - camera.cy) / camera.fy
    x.flags.writeable = y.flags.writeable = False  # all callers share them
    return x, y


def unproject_mask(depth: DepthImage, mask: Mask, camera: PinholeCamera) -> FloatArray:
    """Give the 3D points of the masked pixels that have a depth, row by row (paper, IV-B).

    Args:
        depth: Shape (H, W), metres along the optical axis, NaN where unknown.
        mask: Shape (H, W).
        camera: The camera that took the depth image.

    Returns:
        Shape (N, 3), metres, camera optical frame.

    Raises:
        InvalidInputError: If an image does not have the camera's size.
    """
    _check_shape(depth.shape, camera)
    _check_shape(mask.shape, camera)
    v, u = np.nonzero(mask & np.isfinite(depth))
    z = depth[v, u].astype(np.float64)
    return np.column_stack([(u - camera.cx) / camera.fx * z, (v - camera.cy) / camera.fy * z, z])


def height_above_plane(
    depth: DepthImage, table_plane: FloatArray, camera: PinholeCamera
) -> DepthImage:
    """Distance of each pixel's point from a plane, positive towards the camera.

    Args:
        depth: Shape (H, W), metres, NaN where unknown.
        table_plane: a, b, c, d with a unit normal, camera optical frame.
        camera: The camera that took the depth image.

    Returns:
        Shape (H, W), metres, NaN where the depth is unknown.

    Raises:
        InvalidInputError: If the depth image does not have the camera's size.
    """
    _check_shape(depth.shape, camera)
    height = np.empty(depth.shape, dtype=np.float32)
    offset = np.float32(table_plane[3])
    _add_heights(depth, *ray_parts(table_plane[:3], camera), offset, height)
    return height


def pixels_near_plane(
    depth: DepthImage,
    table_plane: FloatArray,
    camera: PinholeCamera,
    reach: float,
    allowed: Mask | None = None,
) -> NDArray[np.int64]:
    """Find the pixels whose points lie near a plane.

    Args:
        depth: Shape (H, W), metres, NaN where unknown.
        table_plane: a, b, c, d with a unit normal, camera optical frame.
        camera: The camera that took the depth image.
        reach: Largest distance from the plane, metres.
        allowed: Pixels that may be found, shape (H, W); all if None.

    Returns:
        Flat indices, rising, shape (N,).

    Raises:
        InvalidInputError: If the depth image does not have the camera's size.
    """
    _check_shape(depth.shape, camera)
    near = np.empty(depth.shape, dtype=np.bool_)
    parts, offset = ray_parts(table_plane[:3], camera), np.float32(table_plane[3])
    _mark_near(depth, *parts, offset, np.float32(reach), near)
    if allowed is not None:
        near &= allowed
    return np.flatnonzero(near)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _add_parts(of_column: FloatImage, of_row: FloatImage, along: FloatImage) -> None:
    for row in range(along.shape[0]):
        own = of_row[row]
        for column in range(along.shape[1]):
            along[row, column] = of_column[column] + own


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _add_heights(
    depth: DepthImage,
    of_column: FloatImage,
    of_row: FloatImage,
    offset: np.float32,
    height: DepthImage,
) -> None:
    for row in range(depth.shape[0]):
        own = of_row[row]
        for column in range(depth.shape[1]):
            height[row, column] = depth[row, column] * (of_column[column] + own) + offset


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _mark_near(
    depth: DepthImage,
    of_column: FloatImage,
    of_row: FloatImage,
    offset: np.float32,
    reach: np.float32,
    near: Mask,
) -> None:
    for row in range(depth.shape[0]):
        own = of_row[row]
        for column in range(depth.shape[1]):
            height = depth[row, column] * (of_column[column] + own) + offset
            near[row, column] = abs(height) < reach  # not for NaN


def _check_shape(shape: tuple[int, ...], camera: PinholeCamera) -> None:
    if shape != (camera.height, camera.width):
        raise InvalidInputError(
            f"these intrinsics are for {camera.width} x {camera.height} pixels, got an image of "
            f"shape {shape}; use the intrinsics that belong to this image"
        )
