"""The table's plane in a depth image: by RANSAC (Open3D), or from a plane nearly known."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.config import PlaneConfig
from emd_perception.image_types import DepthImage, Mask
from emd_perception.open3d_library import load_open3d, point_cloud

MIN_POINTS = 50
_MOST_FITS = 10


@dataclass(frozen=True)
class TablePlane:
    """The plane a x + b y + c z + d = 0 in the camera optical frame.

    Attributes:
        coefficients: a, b, c, d, shape (4,), metres; (a, b, c) has length 1 and points to the
            camera, so that d is the camera's distance from the plane.
        inlier_share: Share of the points within the distance threshold, 0..1.
    """

    coefficients: FloatArray
    inlier_share: float

    @property
    def normal(self) -> FloatArray:
        """Unit normal towards the camera, shape (3,), camera optical frame."""
        return self.coefficients[:3]


def fit_table_plane(
    depth: DepthImage,
    camera: PinholeCamera,
    config: PlaneConfig | None = None,
    mask: Mask | None = None,
) -> TablePlane:
    """Find the plane that most points of a depth image support.

    The same input gives the same plane: RANSAC starts from `config.random_seed`.

    Args:
        depth: Shape (H, W), metres, NaN where unknown.
        camera: The camera that took it.
        config: Thresholds; the defaults if None.
        mask: Pixels that may take part, shape (H, W); all if None.

    Raises:
        InvalidInputError: If fewer than 50 pixels have a depth.
    """
    known = np.isfinite(depth)
    pixels = np.flatnonzero(known if mask is None else known & mask)
    return fit_plane_to_pixels(depth, camera, pixels, config)


def fit_plane_to_pixels(
    depth: DepthImage,
    camera: PinholeCamera,
    pixels: NDArray[np.int64],
    config: PlaneConfig | None = None,
    nearly: FloatArray | None = None,
) -> TablePlane:
    """Find the plane that most of the given pixels support.

    Args:
        depth: Shape (H, W), metres.
        camera: The camera that took it.
        pixels: Flat indices of pixels that have a depth, rising, shape (N,).
        config: Thresholds; the defaults if None.
        nearly: A plane a, b, c, d that should be near the one looked for, if one is known. Where
            enough pixels support it, it is fitted to those that do until they stay the same, and
            no other plane is tried.

    Raises:
        InvalidInputError: If there are fewer than 50 pixels.
    """
    settings = config or PlaneConfig()
    if len(pixels) < MIN_POINTS:
        raise InvalidInputError(
            f"at least {MIN_POINTS} table pixels with a depth are needed to find the table, got "
            f"{len(pixels)}; does the camera see the table, within the sensor's range?"
        )
    points = _points_at(depth, camera, pixels[:: -(-len(pixels) // settings.max_points)])
    known = None if nearly is None else _fitted_from(points, nearly, settings)
    return _tried_out(points, settings) if known is None else known


def _fitted_from(points: FloatArray, nearly: FloatArray, config: PlaneConfig) -> TablePlane | None:
    """Fit a plane to the points near it, again and again; None if too few are."""
    plane = np.array(nearly, dtype=np.float64)
    support = np.zeros(len(points), dtype=np.bool_)
    least = max(config.min_inlier_share * len(points), MIN_POINTS)
    for _ in range(_MOST_FITS):
        count, same, centre, scatter = _support(points, plane, config.distance_threshold, support)
        if count < least:
            return None
        if same:
            break
        normal = np.linalg.eigh(scatter)[1][:, 0]  # the direction of least spread
        plane = _towards_camera(np.array([*normal, -(normal @ centre)]))
    return TablePlane(plane, count / len(points))


def _tried_out(points: FloatArray, config: PlaneConfig) -> TablePlane:
    """RANSAC."""
    load_open3d().utility.random.seed(config.random_seed)
    # Probability 1 tries every plane. With the default, Open3D's threads stop early, at a plane
    # that differs from run to run in spite of the seed.
    plane, inliers = point_cloud(points).segment_plane(
        config.distance_threshold, 3, config.iterations, probability=1.0
    )
    coefficients = np.asarray(plane, dtype=np.float64)
    coefficients /= np.linalg.norm(coefficients[:3])
    return TablePlane(_towards_camera(coefficients), len(inliers) / len(points))


def _towards_camera(coefficients: FloatArray) -> FloatArray:
    """The same plane with its normal towards the camera."""
    return -coefficients if coefficients[3] < 0 else coefficients


def _points_at(depth: DepthImage, camera: PinholeCamera, pixels: NDArray[np.int64]) -> FloatArray:
    """Points of pixels, shape (N, 3), metres, camera optical frame."""
    rows, columns = np.divmod(pixels, depth.shape[1])
    z = depth[rows, columns].astype(np.float64)
    return np.column_stack(
        [(columns - camera.cx) / camera.fx * z, (rows - camera.cy) / camera.fy * z, z]
    )


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _support(
    points: FloatArray, plane: FloatArray, threshold: float, support: NDArray[np.bool_]
) -> tuple[int, bool, FloatArray, FloatArray]:
    """Find which points (N, 3) lie near a plane (4,), and write them into `support` (N,).

    Returns:
        Their number, whether they are those that `support` held before, their mean (3,), and the
        sum of the products of their offsets from it (3, 3).
    """
    same, count, total, products = True, 0, np.zeros(3), np.zeros((3, 3))
    for point in range(len(points)):
        distance = plane[3]
        for axis in range(3):
            distance += points[point, axis] * plane[axis]
        near = abs(distance) < threshold
        same &= near == support[point]
        support[point] = near
        if near:
            count += 1
            for axis in range(3):
                total[axis] += points[point, axis]
                for other in range(3):
                    products[axis, other] += points[point, axis] * points[point, other]
    centre = total / max(count, 1)
    return count, same, centre, products - count * centre.reshape(3, 1) * centre
