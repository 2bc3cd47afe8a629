"""How the bare table looks, and how far the colour of each pixel is from that."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from emd_core.frames import FloatArray
from emd_perception.config import SegmentationConfig
from emd_perception.image_types import ColourImage, DepthImage, FloatImage, LabImage, Mask

_CONCENTRATION_STEPS = 6
_CONCENTRATED_SHARE = 0.6
# The covariance of a three-dimensional normal sample against that of its nearest 60 %.
_CONSISTENCY = 2.0
_MAX_SAMPLES = 1200
_MIN_SAMPLES = 50
_TREND_RIDGE = 0.02
_TERMS = 6  # of the trend


@dataclass(frozen=True)
class TableAppearance:
    """The table's colour: a smooth trend across the picture (uneven light) and a normal spread.

    Attributes:
        trend: Coefficients of L*, a*, b* over `trend_basis`, shape (6, 3).
        covariance: Of the colours about the trend, shape (3, 3), never below the floors.
    """

    trend: FloatArray
    covariance: FloatArray

    def distance(self, colours: NDArray[Any], basis: NDArray[Any]) -> NDArray[Any]:
        """Mahalanobis distance from the table's colour, in spreads.

        Args:
            colours: L*, a*, b*, shape (N, 3).
            basis: `trend_basis` at the same pixels, shape (N, 6).

        Returns:
            Shape (N,).
        """
        whitening = np.linalg.inv(np.linalg.cholesky(self.covariance)).T.astype(colours.dtype)
        difference = (colours - basis @ self.trend.astype(colours.dtype)) @ whitening
        return np.asarray(np.sqrt(np.einsum("ni,ni->n", difference, difference)))


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
    lab: LabImage, table_candidates: Mask, config: SegmentationConfig
) -> TableAppearance | None:
    """Learn the table's colour from the rim of the region, robustly.

    The rim is where the table shows even if the cloth fills the middle; a cloth that reaches into
    it is left out by concentration steps (as in the minimum covariance determinant estimator,
    Rousseeuw and Van Driessen 1999), as long as most of the rim is table.

    Args:
        lab: Shape (H, W, 3).
        table_candidates: Pixels of the region that lie on the table's plane, shape (H, W).
        config: Spread floors and the share of the region that counts as its rim.

    Returns:
        The table's colour, or None if fewer than 50 pixels are candidates.
    """
    rim = np.flatnonzero(region_rim(table_candidates, config.border_share))
    if len(rim) < _MIN_SAMPLES:
        return None
    samples = rim[:: -(-len(rim) // _MAX_SAMPLES)]
    colours = lab.reshape(-1, 3)[samples].astype(np.float64)
    basis = trend_basis(lab.shape[:2]).reshape(-1, _TERMS)[samples].astype(np.float64)
    floor = np.array([config.lightness_floor, config.chroma_floor, config.chroma_floor])
    trend = np.zeros((basis.shape[1], 3))
    trend[0] = np.median(colours, axis=0)
    appearance = TableAppearance(trend, np.diag(floor**2))
    for _ in range(_CONCENTRATION_STEPS):
        distance = appearance.distance(colours, basis)
        kept = np.argpartition(distance, int(_CONCENTRATED_SHARE * len(distance)))
        kept = np.sort(kept[: int(_CONCENTRATED_SHARE * len(distance))])
        appearance = _fit(colours[kept], basis[kept], floor)
    return appearance


def colour_contrast(lab: LabImage, appearance: TableAppearance) -> FloatImage:
    """Distance of each pixel's colour from the table's, shape (H, W), spreads."""
    basis = trend_basis(lab.shape[:2]).reshape(-1, appearance.trend.shape[0])
    return appearance.distance(lab.reshape(-1, 3), basis).reshape(lab.shape[:2])


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


def _fit(colours: FloatArray, basis: FloatArray, floor: FloatArray) -> TableAppearance:
    """Fit trend (ridge regression, the constant term free) and spread to the colours given."""
    ridge = _TREND_RIDGE * len(colours) * np.eye(basis.shape[1])
    ridge[0, 0] = 0.0
    trend = np.linalg.solve(basis.T @ basis + ridge, basis.T @ colours)
    left = colours - basis @ trend
    left -= left.mean(axis=0)
    covariance = _CONSISTENCY / (len(left) - 1) * (left.T @ left)
    return TableAppearance(np.asarray(trend), _widen(covariance, floor))


def _widen(covariance: FloatArray, floor: FloatArray) -> FloatArray:
    """Widen a covariance so that in no direction it is narrower than the floor."""
    scaled = covariance / np.outer(floor, floor)
    values, vectors = np.linalg.eigh(scaled)
    widened = (vectors * np.maximum(values, 1.0)) @ vectors.T
    return np.asarray(widened * np.outer(floor, floor))
