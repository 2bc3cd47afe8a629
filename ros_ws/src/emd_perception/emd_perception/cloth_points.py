"""The cloth's surface in the table frame, from its pixels and the depth image (paper, IV-B)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emd_core.errors import NoClothError
from emd_core.frames import FloatArray
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.config import VoxelConfig
from emd_perception.image_types import ColourImage, DepthImage, Mask
from emd_perception.masked_surface import masked_surface
from emd_perception.square_means import SquareMeans

_MIN_ALIKE = 2  # of the eight squares around a point


@dataclass(frozen=True)
class ClothPoints:
    """The cloth's surface.

    Attributes:
        points_in_table: Averaged and cleaned points, shape (N, 3), metres, table frame.
        colours: Their mean colours, shape (N, 3), RGB uint8.
        footprint_in_table: x and y of every pixel of the mask, shape (P, 2), metres.
        known_share: Share of the mask's pixels that had a depth, 0..1.
        height_error: Standard error of the mean height of a square of 1 m side, as single pixels
            scatter, metres; that of a smaller square is larger in proportion to 1 / side.
    """

    points_in_table: FloatArray
    colours: NDArray[np.uint8]
    footprint_in_table: FloatArray
    known_share: float
    height_error: float


def cloth_points(
    colour: ColourImage,
    depth: DepthImage,
    mask: Mask,
    camera: PinholeCamera,
    transform_camera_to_table: FloatArray,
    spacing: float,
    config: VoxelConfig | None = None,
) -> ClothPoints:
    """Unproject the cloth's pixels into the table frame, thin them out by averaging, and clean.

    Args:
        colour: Shape (H, W, 3), RGB uint8.
        depth: Shape (H, W), metres, NaN where unknown.
        mask: The cloth's pixels, shape (H, W).
        camera: The camera of both images.
        transform_camera_to_table: Shape (4, 4), metres.
        spacing: Side of the squares over which points are averaged, metres.
        config: Outlier removal; the defaults if None.

    Raises:
        NoClothError: If no pixel of the mask has a depth, or the depths are nothing but noise.
    """
    settings = config or VoxelConfig()
    surface = masked_surface(
        colour, depth, mask, camera, transform_camera_to_table, settings.max_spike
    )
    if len(surface.known_points_in_table) == 0:
        raise NoClothError(
            "the cloth was seen in the colour image, but no pixel of it has a depth; is it nearer "
            "than the sensor's minimum range, or black to its infrared light?"
        )
    squares = SquareMeans.of(surface.known_points_in_table, surface.known_colours, spacing)
    kept = squares.alike_beside(settings.max_lone_height) >= min(_MIN_ALIKE, len(squares) - 1)
    if not kept.any():
        raise NoClothError(
            f"no two points of the cloth that lie beside each other agree to "
            f"{settings.max_lone_height * 1000:.0f} mm in height; the depth is noise there"
        )
    return ClothPoints(
        squares.points[kept],
        np.rint(squares.values[kept]).astype(np.uint8),
        surface.footprint_in_table,
        surface.known_share,
        spacing * _scatter(squares) / float(np.sqrt(squares.counts.mean())),
    )


def _scatter(squares: SquareMeans) -> float:
    """Standard deviation of single points' heights, metres; infinite where no two share a square.

    Few points scatter less about their own mean than about the true height (Bessel).
    """
    counts = squares.counts
    several = counts >= 2
    if not several.any():
        return float("inf")
    unbiased = squares.spread[several] * np.sqrt(counts[several] / (counts[several] - 1.0))
    return float(np.median(unbiased))
