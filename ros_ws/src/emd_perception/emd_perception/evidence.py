"""What each pixel says about being cloth, at the reduced size of the first cut."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from emd_core.errors import NoClothError
from emd_perception.block_means import reduce_colour, reduce_known
from emd_perception.config import SegmentationConfig
from emd_perception.image_types import ColourImage, DepthImage, FloatImage, LabImage, Mask
from emd_perception.mask_morphology import erode, resize_mask
from emd_perception.table_appearance import (
    colour_contrast,
    lab_from_rgb,
    learn_table_appearance,
    region_rim,
    trend_basis,
)
from emd_perception.trend_fit import fit_heights

_LIKE_TABLE = 2.5  # spreads of colour; a pixel so near to the table's colour may show it bare
_MIN_BARE = 50
_LEAST_KNOWN = 0.15  # share of the pixels of which a reduced one is made
_MAX_SAMPLES = 3000  # pixels of which the table's height is learnt
_NEAR_PLANE = 0.012  # metres; candidates for bare table, wide enough for a Kinect's distortion


@dataclass(frozen=True)
class Evidence:
    """The reduced picture and how unlike the table each of its pixels is.

    Attributes:
        lab: Reduced colour, shape (h, w, 3), CIE L*a*b*.
        height: Smoothed height above the table, shape (h, w), metres, NaN where unknown.
        region: Pixels of interest, shape (h, w).
        rise: Height above the bare table's trend, shape (h, w), spreads; 0 where unknown.
        rise_spread: What a spread of `rise` is, metres: how finely the sensor tells heights here.
        contrast: Distance from the table in colour and height, shape (h, w), spreads.
        threshold: Contrast that divides table from cloth best (Otsu), within configured bounds.
        pixel_area: Table area of one reduced pixel, shape (h, w), square metres.
    """

    lab: LabImage
    height: DepthImage
    region: Mask
    rise: FloatImage
    rise_spread: float
    contrast: FloatImage
    threshold: float
    pixel_area: FloatImage

    @property
    def unlike_table(self) -> Mask:
        """Pixels whose contrast exceeds the threshold, shape (h, w)."""
        return self.contrast > self.threshold

    @cached_property
    def rim(self) -> Mask:
        """Pixels of the region at its outside, shape (h, w)."""
        return self.region & ~erode(self.region, 5)


def gather_evidence(
    colour: ColourImage,
    height: DepthImage,
    pixel_area: FloatImage,
    region: Mask,
    config: SegmentationConfig,
) -> Evidence:
    """Measure the contrast of each pixel with the bare table.

    The contrast is a Mahalanobis distance in L*, a*, b* and height: colour finds flat cloth,
    height adds folds of the table's colour. (Height alone misses flat parts under a Kinect's
    noise, and a rectangle as GraphCut's start fails under a lamp.)

    Args:
        colour: Shape (H, W, 3), RGB uint8.
        height: Height above the table, shape (H, W), metres, NaN where unknown.
        pixel_area: Table area that a pixel covers, shape (H, W), square metres.
        region: Pixels of interest, shape (H, W).
        config: Spreads and bounds.

    Raises:
        NoClothError: If no bare table is in view, from which to tell the cloth.
    """
    shape = reduced_shape(height.shape, config.working_pixels)
    factor = height.size / (shape[0] * shape[1])
    lab = lab_from_rgb(reduce_colour(colour, shape))
    lab = np.asarray(cv2.GaussianBlur(lab, (3, 3), 0), dtype=np.float32)
    small_height = reduce_height(height, shape)
    small_region = resize_mask(region, shape)
    candidates = small_region & (np.abs(small_height) < _NEAR_PLANE)
    rim = region_rim(candidates, config.border_share)
    appearance = learn_table_appearance(lab, rim, config)
    if appearance is None:
        raise NoClothError(
            "no bare table is in view, so the cloth cannot be told from it; widen the view or "
            "check the extrinsics"
        )
    colours = colour_contrast(lab, appearance)
    bare = rim & (colours < _LIKE_TABLE)
    rise, rise_spread = height_contrast(small_height, bare, config.height_floor)
    contrast = np.hypot(colours, rise)
    low = small_region & ~(small_height > config.max_height)
    threshold = float(np.clip(_otsu(contrast[low]), config.min_contrast, config.max_contrast))
    return Evidence(
        lab,
        small_height,
        small_region,
        rise,
        rise_spread,
        contrast,
        threshold,
        _reduce(pixel_area, shape) * np.float32(factor),
    )


def reduced_shape(shape: tuple[int, ...], working_pixels: int) -> tuple[int, int]:
    """Rows and columns of an image reduced to about `working_pixels`, sides in proportion."""
    scale = min(1.0, float(np.sqrt(working_pixels / (shape[0] * shape[1]))))
    return max(1, round(shape[0] * scale)), max(1, round(shape[1] * scale))


def reduce_height(height: DepthImage, shape: tuple[int, int]) -> DepthImage:
    """Average heights over the pixels that make one reduced pixel and its neighbours.

    Args:
        height: Shape (H, W), metres, NaN where unknown; unknown pixels are left out.
        shape: Rows and columns wanted, (h, w).

    Returns:
        Shape (h, w), metres; NaN where hardly a pixel is known.
    """
    total, weight = (cv2.GaussianBlur(one, (3, 3), 0) for one in reduce_known(height, shape))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(weight > _LEAST_KNOWN, total / weight, np.nan).astype(np.float32)


def _reduce(image: FloatImage, shape: tuple[int, int]) -> FloatImage:
    reduced = cv2.resize(image, shape[::-1], interpolation=cv2.INTER_NEAREST)
    return np.asarray(reduced, dtype=np.float32)


def height_contrast(height: DepthImage, bare: Mask, floor: float) -> tuple[FloatImage, float]:
    """Height above the bare table in spreads of what is measured there.

    The table's height is a smooth trend across the picture, as sensors bend planes.

    Args:
        height: Smoothed, shape (h, w), metres, NaN where unknown.
        bare: Pixels that show the bare table, shape (h, w).
        floor: Least spread that is assumed, metres.

    Returns:
        Shape (h, w), 0 below the table and where unknown; and the spread, metres.
    """
    basis = trend_basis(height.shape)
    known = bare & np.isfinite(height)
    if known.sum() < _MIN_BARE:
        known = np.isfinite(height) & (np.abs(height) < _NEAR_PLANE)
    chosen = np.flatnonzero(known)
    chosen = chosen[:: -(-len(chosen) // _MAX_SAMPLES) or 1]
    samples = basis.reshape(-1, basis.shape[-1])[chosen].astype(np.float64)
    heights = height.ravel()[chosen].astype(np.float64)
    trend, spread = fit_heights(heights, samples, floor, _NEAR_PLANE, _MIN_BARE)
    level = (basis.reshape(-1, basis.shape[-1]) @ trend.astype(np.float32)).reshape(height.shape)
    rise = (height - level) / np.float32(spread)
    rise[~(rise > 0.0)] = 0.0  # NaN too
    return rise, spread


def _otsu(contrast: NDArray[Any]) -> float:
    """Threshold that divides the values best into two classes, values above 10 taken as 10."""
    steps = np.minimum(contrast * 25.0, 250.0).astype(np.uint8).reshape(-1, 1)
    threshold, _ = cv2.threshold(steps, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    return float(threshold) / 25.0
