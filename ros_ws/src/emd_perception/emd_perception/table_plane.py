"""The table's plane in a depth image, by RANSAC (Open3D)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.config import PlaneConfig
from emd_perception.image_types import DepthImage, Mask
from emd_perception.open3d_library import load_open3d, point_cloud
from emd_perception.unprojection import unproject_mask

MIN_POINTS = 50


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
    settings = config or PlaneConfig()
    allowed = np.ones(depth.shape, dtype=bool) if mask is None else mask
    points = _thin_out(depth, allowed, camera, settings.max_points)
    if len(points) < MIN_POINTS:
        raise InvalidInputError(
            f"at least {MIN_POINTS} table pixels with a depth are needed to find the table, got "
            f"{len(points)}; does the camera see the table, within the sensor's range?"
        )
    load_open3d().utility.random.seed(settings.random_seed)
    # Probability 1 tries every plane. With the default, Open3D's threads stop early, at a plane
    # that differs from run to run in spite of the seed.
    plane, inliers = point_cloud(points).segment_plane(
        settings.distance_threshold, 3, settings.iterations, probability=1.0
    )
    coefficients = np.asarray(plane, dtype=np.float64)
    coefficients /= np.linalg.norm(coefficients[:3])
    if coefficients[3] < 0:
        coefficients = -coefficients
    return TablePlane(coefficients, len(inliers) / len(points))


def _thin_out(
    depth: DepthImage, allowed: Mask, camera: PinholeCamera, max_points: int
) -> FloatArray:
    """Take every n-th allowed pixel with a depth, at most `max_points` of them."""
    index = np.flatnonzero(allowed & np.isfinite(depth))
    chosen = np.zeros(depth.size, dtype=bool)
    chosen[index[:: max(1, -(-len(index) // max_points))]] = True
    return unproject_mask(depth, chosen.reshape(depth.shape), camera)
