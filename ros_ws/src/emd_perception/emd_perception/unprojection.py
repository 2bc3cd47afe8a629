"""From depth to 3D points in the camera optical frame (x right, y down, z forward)."""

from __future__ import annotations

import numpy as np

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
    of_column, of_row = ray_parts(direction, camera)
    return np.add(of_column[None, :], of_row[:, None], dtype=np.float32)


def ray_parts(directions: FloatArray, camera: PinholeCamera) -> tuple[FloatArray, FloatArray]:
    """Split the components of the pixels' rays (z = 1) along directions, so that none is built.

    Args:
        directions: Shape (..., 3), camera optical frame.
        camera: The camera of the pixels.

    Returns:
        A part for each column, shape (..., W), and one for each row, shape (..., H); a ray's
        component is the sum of its two.
    """
    a, b, c = np.moveaxis(np.asarray(directions, dtype=np.float64), -1, 0)[..., None]
    of_column = a * (np.arange(camera.width) - camera.cx) / camera.fx + c
    return of_column, b * (np.arange(camera.height) - camera.cy) / camera.fy


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
    along = along_rays(table_plane[:3], camera)
    return np.asarray(depth * along + np.float32(table_plane[3]), dtype=np.float32)


def _check_shape(shape: tuple[int, ...], camera: PinholeCamera) -> None:
    if shape != (camera.height, camera.width):
        raise InvalidInputError(
            f"these intrinsics are for {camera.width} x {camera.height} pixels, got an image of "
            f"shape {shape}; use the intrinsics that belong to this image"
        )
