"""How the bare table looks, and how far the colour of each pixel is from that."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from emd_core.frames import FloatArray
from emd_perception.config import SegmentationConfig
from emd_perception.image_types import ColourImage, DepthImage, FloatImage, LabImage, Mask
from emd_perception.trend_fit import TERMS, fit_colours

_MAX_SAMPLES = 1200
_MIN_SAMPLES = 50


@dataclass(frozen=True)
class TableAppearance:
    """The table's colour: a smooth trend across the picture (uneven light) and a normal spread.

    Attributes:
        trend: Coefficients of L*, a*, b* over `trend_basis`, shape (6, 3).
        covariance: Of the colours about the trend, shape (3, 3), never below the floors.
    """

    trend: FloatArray
    covariance: FloatArray


def lab_from_rgb(colour: ColourImage) -> LabImage:
    """Convert RGB (H, W, 3) uint8 to CIE L*a*b* float32 (L* 0..100, a* and b* about +-100)."""
    scaled = colour.astype(np.float32) / np.float32(255.0)
    return np.asarray(cv2.cvtColor(scaled, cv2.COLOR_RGB2LAB), dtype=np.float32)


@lru_cache(maxsize=8)
def trend_basis(shape: tuple[int, int]) -> NDArray[np.float32]:
    """Quadratic polynomials of the pixel's place, -1..1 across the picture, shape (H, W, 6)."""
    v, u = np.meshgrid(np.linspace(-1, 1, shape[0]), np.linspace(-1, 1, shape[1]), indexing="ij")
    basis = np.stack([np.ones(shape), u, v, u * u, u * v, v * v], axis=-1).astype(np.float32)
    basis.flags.writeable = False  # all callers share it
    return basis


def learn_table_appearance(
    lab: LabImage, rim: Mask, config: SegmentationConfig
) -> TableAppearance | None:
    """Learn the table's colour from the rim of the region, robustly.

    The rim is where the table shows even if the cloth fills the middle; a cloth that reaches into
    it is left out, as long as most of the rim is table.

    Args:
        lab: Shape (H, W, 3).
        rim: Pixels at the region's rim that lie on the table's plane, shape (H, W).
        config: Spread floors.

    Returns:
        The table's colour, or None if the rim has fewer than 50 pixels.
    """
    pixels = np.flatnonzero(rim)
    if len(pixels) < _MIN_SAMPLES:
        return None
    samples = pixels[:: -(-len(pixels) // _MAX_SAMPLES)]
    colours = lab.reshape(-1, 3)[samples].astype(np.float64)
    basis = trend_basis(lab.shape[:2]).reshape(-1, TERMS)[samples].astype(np.float64)
    floor = np.array([config.lightness_floor, config.chroma_floor, config.chroma_floor])
    return TableAppearance(*fit_colours(colours, basis, floor))


def colour_contrast(lab: LabImage, appearance: TableAppearance) -> FloatImage:
    """Mahalanobis distance of each pixel's colour from the table's, shape (H, W), spreads."""
    contrast = np.empty(lab.shape[:2], dtype=np.float32)
    # So that the distance is the length of whitening (colour - trend).
    whitening = np.linalg.inv(np.linalg.cholesky(appearance.covariance))
    whitened_trend = (appearance.trend @ whitening.T).astype(np.float32)
    basis = trend_basis(lab.shape[:2])
    _fill_distances(lab, basis, whitened_trend, whitening.astype(np.float32), contrast)
    return contrast


def region_rim(region: Mask, share: float) -> Mask:
    """The pixels of a region that are nearest its outside, about `share` of them."""
    if not region.any():
        return region
    padded = cv2.copyMakeBorder(region.astype(np.uint8), 5, 5, 5, 5, cv2.BORDER_CONSTANT, value=0)
    closed = cv2.morphologyEx(padded, cv2.MORPH_CLOSE, np.ones((9, 9), np.uint8))
    inward = cv2.distanceTransform(closed, cv2.DIST_L2, 3)[5:-5, 5:-5]
    return region & np.asarray(inward <= np.quantile(inward[region], share))


def smooth_height(height: DepthImage, side: int = 5) -> DepthImage:
    """Average heights over a square of `side` pixels, unknown ones left out; NaN without any."""
    known = np.isfinite(height)
    size = (side, side)
    total = cv2.blur(np.where(known, height, 0.0).astype(np.float32), size)
    weight = np.asarray(cv2.blur(known.astype(np.float32), size))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(weight > 0.15, total / weight, np.nan).astype(np.float32)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _fill_distances(
    lab: LabImage,
    basis: NDArray[np.float32],
    trend: NDArray[np.float32],
    whitening: NDArray[np.float32],
    distance: FloatImage,
) -> None:
    for row in range(lab.shape[0]):
        for column in range(lab.shape[1]):
            squared = np.float32(0.0)
            for axis in range(3):
                along = np.float32(0.0)
                for channel in range(3):
                    along += whitening[axis, channel] * lab[row, column, channel]
                for term in range(TERMS):
                    along -= basis[row, column, term] * trend[term, axis]
                squared += along * along
            distance[row, column] = np.sqrt(squared)
