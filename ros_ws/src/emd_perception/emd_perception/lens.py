"""Takes a lens's distortion out of pixels and pictures (OpenCV)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from emd_core.frames import FloatArray
from emd_core.lens_distortion import LensDistortion
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.image_types import ColourImage

_PRECISE = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 50, 1e-9)


def camera_matrix(camera: PinholeCamera) -> FloatArray:
    """Give K of the pinhole model, shape (3, 3), pixels."""
    return np.array([[camera.fx, 0.0, camera.cx], [0.0, camera.fy, camera.cy], [0.0, 0.0, 1.0]])


def pixel_directions(camera: PinholeCamera, lens: LensDistortion) -> FloatArray:
    """Give where each pixel of the distorted picture looks.

    Args:
        camera: Intrinsics; pixel centres lie at whole numbers.
        lens: Its distortion.

    Returns:
        Shape (H, W, 2): x and y at z = 1 in the optical frame.
    """
    rows, columns = np.mgrid[: camera.height, : camera.width].astype(np.float64)
    pixels = np.stack([columns, rows], axis=-1).reshape(-1, 1, 2)
    if lens.is_none:
        straight = (pixels - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
    else:
        undistort = (
            cv2.fisheye.undistortPoints if lens.model == "equidistant" else cv2.undistortPoints
        )
        matrix, coefficients = camera_matrix(camera), np.array(lens.coefficients)
        found = undistort(pixels, matrix, coefficients, criteria=_PRECISE)
        straight = np.asarray(found, dtype=np.float64)
    return straight.reshape(camera.height, camera.width, 2)


def distort_points(
    directions: FloatArray, camera: PinholeCamera, lens: LensDistortion
) -> FloatArray:
    """Give the pixels at which a distorting camera sees directions.

    Args:
        directions: Shape (N, 2): x and y at z = 1 in the optical frame.
        camera: Intrinsics.
        lens: Its distortion.

    Returns:
        Shape (N, 2): column and row.
    """
    matrix, coefficients = camera_matrix(camera), np.array(lens.coefficients)
    if lens.model == "equidistant" and not lens.is_none:
        pixels = cv2.fisheye.distortPoints(directions.reshape(-1, 1, 2), matrix, coefficients)
    else:
        rays = np.column_stack([directions, np.ones(len(directions))])
        zero = np.zeros(3)
        pixels, _ = cv2.projectPoints(rays, zero, zero, matrix, coefficients)
    return np.asarray(pixels, dtype=np.float64).reshape(-1, 2)


class ColourRectifier:
    """Turns pictures of a distorting lens into those of a pinhole camera with the same K."""

    def __init__(self, camera: PinholeCamera, lens: LensDistortion) -> None:
        """Take the camera; its tables are made with the first picture."""
        self._camera, self._lens = camera, lens
        self._maps: tuple[NDArray[np.float32], NDArray[np.float32]] | None = None

    def rectify(self, colour: ColourImage) -> ColourImage:
        """Straighten a picture, shape (H, W, 3); what the lens did not see becomes black."""
        if self._lens.is_none:
            return colour
        if self._maps is None:
            straight = pixel_directions(self._camera, LensDistortion()).reshape(-1, 2)
            sources = distort_points(straight, self._camera, self._lens).astype(np.float32)
            shape = (self._camera.height, self._camera.width)
            self._maps = (sources[:, 0].reshape(shape), sources[:, 1].reshape(shape))
        return np.asarray(cv2.remap(colour, *self._maps, cv2.INTER_LINEAR), dtype=np.uint8)
