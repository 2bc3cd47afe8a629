"""Depth images and colour images as the core wants them (REP 118)."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from emd_core.errors import InvalidInputError
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.image_types import ColourImage, DepthImage

# ROS's names for the two kinds of depth image, and those OpenCV's bridge uses for the same.
_TYPES = {"16UC1": "uint16", "mono16": "uint16", "32FC1": "float32"}


def depth_in_metres(depth: NDArray[Any], encoding: str | None = None) -> DepthImage:
    """Convert a depth image of either kind to float32 metres with NaN for unknown.

    Args:
        depth: Shape (H, W) or (H, W, 1); uint16 millimetres with 0 for unknown (16UC1), or
            float32 or float64 metres with NaN for unknown (32FC1). Values <= 0 and infinities
            are unknown too.
        encoding: ROS's name of the kind, if known: 16UC1, mono16 or 32FC1.

    Returns:
        Shape (H, W), float32, metres, NaN where unknown; a copy.

    Raises:
        InvalidInputError: If shape, type or encoding is another one, or they contradict.
    """
    single = depth[..., 0] if depth.ndim == 3 and depth.shape[2] == 1 else depth
    if single.ndim != 2:
        raise InvalidInputError(
            f"a depth image must have one channel, shape (H, W), got {depth.shape}; is this the "
            "colour image?"
        )
    if encoding is not None and _TYPES.get(encoding) != single.dtype.name:
        raise InvalidInputError(
            f"a depth image must be 16UC1 (uint16) or 32FC1 (float32), got encoding {encoding} "
            f"with {single.dtype}; set the camera driver to one of these"
        )
    if single.dtype not in (np.uint16, np.float32, np.float64):
        raise InvalidInputError(
            "a depth image must be uint16 millimetres (16UC1) or float32 metres (32FC1), got "
            f"{single.dtype}; convert it first"
        )
    metres = np.empty(single.shape, dtype=np.float32)
    unit = np.float32(1e-3 if single.dtype == np.uint16 else 1.0)
    _fill_metres(np.ascontiguousarray(single), unit, metres)
    return metres


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _fill_metres(image: NDArray[Any], unit: np.float32, metres: DepthImage) -> None:
    unknown = np.float32(np.nan)
    for row in range(image.shape[0]):
        for column in range(image.shape[1]):
            value = np.float32(image[row, column]) * unit
            metres[row, column] = value if 0.0 < value < np.inf else unknown


def check_images(colour: ColourImage, depth: DepthImage, camera: PinholeCamera) -> None:
    """Check that colour, depth and camera belong together.

    Args:
        colour: Wanted: shape (H, W, 3), uint8, RGB.
        depth: Wanted: shape (H, W), floating point metres, registered to the colour image.
        camera: The camera of the colour image.

    Raises:
        InvalidInputError: If a shape or type is wrong, the sizes differ, or no depth is valid.
    """
    if colour.ndim != 3 or colour.shape[2] != 3 or colour.dtype != np.uint8:
        raise InvalidInputError(
            "a colour image must be RGB with 8 bits, shape (H, W, 3), got shape "
            f"{colour.shape} of {colour.dtype}; convert it to rgb8"
        )
    if depth.ndim != 2 or not np.issubdtype(depth.dtype, np.floating):
        raise InvalidInputError(
            f"depth must be floating point metres (H, W), got shape {depth.shape} of "
            f"{depth.dtype}; use depth_in_metres"
        )
    if colour.shape[:2] != depth.shape:
        raise InvalidInputError(
            f"colour and depth must have the same size, got {_size(colour)} and {_size(depth)}; "
            "use the depth that is registered to the colour camera"
        )
    if depth.shape != (camera.height, camera.width):
        raise InvalidInputError(
            f"the intrinsics are for {camera.width} x {camera.height}, the images have "
            f"{_size(depth)}; use the camera_info of these images"
        )
    if not np.isfinite(depth).any():
        raise InvalidInputError(
            "the depth image has no valid value; is the sensor nearer than its minimum range, or "
            "the unit wrong?"
        )


def _size(image: NDArray[Any]) -> str:
    return f"{image.shape[1]} x {image.shape[0]}"
