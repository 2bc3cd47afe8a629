"""GraphCut: the cloth's outline from colour, with seeds instead of a user (paper, IV-B).

The first cut is OpenCV's grabCut (Rother et al. 2004) on a reduced picture: colour mixtures for
cloth and rest, and a minimum cut that prefers outlines along colour edges. At full resolution
only a narrow band along that outline is cut again, with the mixtures already found.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from emd_core.errors import NoClothError
from emd_perception.band_cut import band_along, cut_band
from emd_perception.colour_mixtures import ColourMixtures
from emd_perception.config import SegmentationConfig
from emd_perception.image_types import ColourImage, LabImage, Mask
from emd_perception.mask_morphology import bounding_window, dilate

_NO_RECTANGLE = (0, 0, 0, 0)  # the labels say what the rectangle would
_MIN_SEEDS = 20  # grabCut clusters the seeds of each side into five colours
_MARGIN = 10  # reduced pixels around what may be cloth, from which the table's colours are learnt


@dataclass(frozen=True)
class Seeds:
    """Where the cut starts, shapes (h, w).

    Attributes:
        cloth: Probably cloth; the rest is probably not.
        surely_cloth: Stays cloth.
        surely_not: Stays background.
    """

    cloth: Mask
    surely_cloth: Mask
    surely_not: Mask

    def as_grab_cut_mask(self) -> NDArray[np.uint8]:
        """Labels as grabCut wants them."""
        labels = np.where(self.cloth, cv2.GC_PR_FGD, cv2.GC_PR_BGD).astype(np.uint8)
        labels[self.surely_cloth] = cv2.GC_FGD
        labels[self.surely_not] = cv2.GC_BGD
        return labels


@dataclass(frozen=True)
class Hands:
    """Hands and other things above the cloth, shapes (H, W).

    Attributes:
        pixels: Their outline by height; never cloth.
        near: Where they and their rim are; what is cloth there is told at full resolution.
    """

    pixels: Mask
    near: Mask


def cut(
    lab: LabImage,
    seeds: Seeds,
    config: SegmentationConfig,
    known_mixtures: ColourMixtures | None = None,
) -> tuple[Mask, ColourMixtures]:
    """Cut the reduced picture along the best outline.

    Args:
        lab: Shape (h, w, 3), CIE L*a*b*.
        seeds: Start; both sides must have pixels.
        config: Iterations, seed and chroma gain.
        known_mixtures: Of an earlier frame of the same scene; they are kept as they are, which
            takes one cut of the pixels that are not sure. If None, mixtures are learnt from the
            seeds.

    Returns:
        The cloth's mask, shape (h, w), and the mixtures it came from.

    Raises:
        NoClothError: If cloth or background has hardly any seed.
    """
    labels = seeds.as_grab_cut_mask()
    cloth_count = int((labels & 1).sum())
    if min(cloth_count, labels.size - cloth_count) < _MIN_SEEDS:
        raise NoClothError(
            f"at least {_MIN_SEEDS} pixels of cloth and as many of table are needed, got "
            f"{cloth_count} and {labels.size - cloth_count}; show bare table around the cloth"
        )
    window = bounding_window(labels != cv2.GC_BGD, _MARGIN)
    part = labels[window]
    picture = _stretch_chroma(lab[window], config.chroma_gain)
    mask = np.zeros(labels.shape, dtype=bool)
    if known_mixtures is not None:
        open_pixels = (part == cv2.GC_PR_FGD) | (part == cv2.GC_PR_BGD)
        mask[window] = cut_band(picture, part == cv2.GC_FGD, open_pixels, known_mixtures)
        return mask, known_mixtures
    background, cloth = np.zeros((1, 65)), np.zeros((1, 65))
    part = part.copy()
    cv2.setRNGSeed(config.random_seed)
    cv2.grabCut(
        picture,
        part,
        _NO_RECTANGLE,
        background,
        cloth,
        config.iterations,
        cv2.GC_INIT_WITH_MASK,
    )
    mask[window] = part & 1
    return mask, ColourMixtures(background, cloth)


def refine(
    colour: ColourImage,
    reduced_mask: Mask,
    mixtures: ColourMixtures,
    config: SegmentationConfig,
    hands: Hands | None = None,
) -> Mask:
    """Cut again at full resolution, within a band along the outline of the first cut.

    Args:
        colour: Shape (H, W, 3), RGB uint8.
        reduced_mask: Mask of the first cut, shape (h, w).
        mixtures: Colour mixtures of the first cut.
        config: Band and chroma gain.
        hands: What else is in view, if anything.

    Returns:
        Shape (H, W).
    """
    coarse = _enlarge(reduced_mask, (colour.shape[1], colour.shape[0]))
    if config.refined_band == 0 or reduced_mask.shape == coarse.shape:
        return coarse if hands is None else coarse & ~hands.pixels
    reach = round(config.refined_band * colour.shape[0] / reduced_mask.shape[0])
    window = bounding_window(coarse, 4 * reach)
    inside = coarse[window]
    band = band_along(inside, reach)
    if hands is not None:
        inside = inside & ~hands.pixels[window]
        band |= hands.near[window] & dilate(inside, 6 * reach + 1)
        band &= ~hands.pixels[window]
    refined = np.zeros_like(coarse)
    picture = _picture(colour[window], dilate(band, 3), config.chroma_gain)
    refined[window] = cut_band(picture, inside, band, mixtures)
    return refined


def _stretch_chroma(lab: LabImage, chroma_gain: float) -> NDArray[np.uint8]:
    """Three 8-bit channels whose distances weigh chroma more than lightness."""
    g = chroma_gain
    linear = np.array([[1, 0, 0, 0], [0, g, 0, 128], [0, 0, g, 128]], dtype=np.float32)
    stretched = np.rint(cv2.transform(lab, linear))
    return np.clip(stretched, 0, 255, out=stretched).astype(np.uint8)


def _picture(colour: ColourImage, wanted: Mask, chroma_gain: float) -> NDArray[np.uint8]:
    """The same straight from 8-bit colours, by way of OpenCV's 8-bit L*a*b*, where wanted."""
    pixels = np.flatnonzero(wanted)
    picture = np.zeros(colour.shape, dtype=np.uint8)
    if len(pixels) > 0:
        own = np.take(np.ascontiguousarray(colour).reshape(-1, 3), pixels, axis=0)
        lab = cv2.cvtColor(own[None], cv2.COLOR_RGB2LAB)
        _place(cv2.LUT(lab, _stretch_table(chroma_gain))[0], pixels, picture.reshape(-1, 3))
    return picture


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _place(
    values: NDArray[np.uint8], pixels: NDArray[np.int64], picture: NDArray[np.uint8]
) -> None:
    """Write values (N, 3) into pixels (N,) of a picture (P, 3), ten times as fast as NumPy."""
    for index in range(len(pixels)):
        for channel in range(3):
            picture[pixels[index], channel] = values[index, channel]


@lru_cache(maxsize=4)
def _stretch_table(chroma_gain: float) -> NDArray[np.uint8]:
    """Stretched chroma for each level of OpenCV's 8-bit L*a*b*, shape (1, 256, 3)."""
    levels = np.arange(256, dtype=np.float64)
    chroma = (levels - 128.0) * chroma_gain + 128.0
    table = np.stack([levels * 100.0 / 255.0, chroma, chroma], axis=-1)
    return np.clip(np.rint(table), 0, 255).astype(np.uint8)[None]


def _enlarge(mask: Mask, size: tuple[int, int]) -> Mask:
    smooth = cv2.resize(mask.astype(np.float32), size, interpolation=cv2.INTER_LINEAR)
    return np.asarray(smooth >= 0.5)
