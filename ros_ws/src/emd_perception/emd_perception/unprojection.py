"""From depth to 3D points in the camera optical frame (x right, y down, z forward)."""

from __future__ import annotations

import numpy as np

from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.image_types import DepthImage, Mask


def pixel_rays(camera: PinholeCamera) -> FloatArray:
    """Direction of each pixel in the camera optical frame with z = 1, shape (H, W, 3)."""
    return camera.unproject(np.ones((camera.height, camera.width)))


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
    a, b, c, d = table_plane
    u = a * (np.arange(camera.width) - camera.cx) / camera.fx + c
    v = b * (np.arange(camera.height) - camera.cy) / camera.fy
    return np.asarray(depth * (u[None, :] + v[:, None]) + d, dtype=np.float32)


def _check_shape(shape: tuple[int, ...], camera: PinholeCamera) -> None:
    if shape != (camera.height, camera.width):
        raise InvalidInputError(
            f"these intrinsics are for {camera.width} x {camera.height} pixels, got an image of "
            f"shape {shape}; use the intrinsics that belong to this image"
        )
