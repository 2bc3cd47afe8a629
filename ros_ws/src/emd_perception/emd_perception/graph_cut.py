"""GraphCut: the cloth's outline from colour, with seeds instead of a user (paper, IV-B).

The cut is OpenCV's grabCut (Rother et al. 2004): colour mixtures for cloth and rest, and a minimum
cut that prefers outlines along colour edges. It is made on a reduced picture; at full resolution
only a narrow band along that outline is cut again, with the mixtures already found.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from emd_core.errors import NoClothError
from emd_perception.config import SegmentationConfig
from emd_perception.image_types import ColourImage, LabImage, Mask
from emd_perception.mask_morphology import dilate, erode
from emd_perception.table_appearance import lab_from_rgb

_NO_RECTANGLE = (0, 0, 0, 0)  # the labels say what the rectangle would
_MIN_SEEDS = 20  # grabCut clusters the seeds of each side into five colours


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
class ColourMixtures:
    """The colour mixtures of both sides, in grabCut's own form, shape (1, 65) each."""

    background: NDArray[np.float64]
    cloth: NDArray[np.float64]


def cut(lab: LabImage, seeds: Seeds, config: SegmentationConfig) -> tuple[Mask, ColourMixtures]:
    """Cut the reduced picture along the best outline.

    Args:
        lab: Shape (h, w, 3), CIE L*a*b*.
        seeds: Start; both sides must have pixels.
        config: Iterations, seed and chroma gain.

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
    background, cloth = np.zeros((1, 65)), np.zeros((1, 65))
    cv2.setRNGSeed(config.random_seed)
    cv2.grabCut(
        _picture(lab, config.chroma_gain),
        labels,
        _NO_RECTANGLE,
        background,
        cloth,
        config.iterations,
        cv2.GC_INIT_WITH_MASK,
    )
    return (labels & 1).astype(bool), ColourMixtures(background, cloth)


def refine(
    colour: ColourImage, reduced_mask: Mask, mixtures: ColourMixtures, config: SegmentationConfig
) -> Mask:
    """Cut again at full resolution, within a band along the outline of the first cut.

    Args:
        colour: Shape (H, W, 3), RGB uint8.
        reduced_mask: Mask of the first cut, shape (h, w).
        mixtures: Colour mixtures of the first cut.
        config: Band and chroma gain.

    Returns:
        Shape (H, W).
    """
    size = (colour.shape[1], colour.shape[0])
    coarse = _enlarge(reduced_mask, size)
    if config.refined_band == 0 or reduced_mask.shape == coarse.shape:
        return coarse
    scale = colour.shape[0] / reduced_mask.shape[0]
    reach = 2 * round(config.refined_band * scale) + 1
    window = _window(coarse, 2 * reach)
    inside = coarse[window]
    labels = np.where(inside, cv2.GC_PR_FGD, cv2.GC_PR_BGD).astype(np.uint8)
    labels[erode(inside, reach, outside=True)] = cv2.GC_FGD
    labels[~dilate(inside, reach)] = cv2.GC_BGD
    lab = lab_from_rgb(colour[window])
    cv2.grabCut(
        _picture(lab, config.chroma_gain),
        labels,
        _NO_RECTANGLE,
        mixtures.background.copy(),
        mixtures.cloth.copy(),
        1,
        cv2.GC_EVAL_FREEZE_MODEL,
    )
    refined = np.zeros_like(coarse)
    refined[window] = (labels & 1).astype(bool)
    return refined


def _picture(lab: LabImage, chroma_gain: float) -> NDArray[np.uint8]:
    """Three 8-bit channels whose distances weigh chroma more than lightness."""
    gain = np.array([1.0, chroma_gain, chroma_gain], dtype=np.float32)
    stretched = lab * gain + np.array([0.0, 128.0, 128.0], dtype=np.float32)
    return np.clip(np.rint(stretched), 0, 255).astype(np.uint8)


def _enlarge(mask: Mask, size: tuple[int, int]) -> Mask:
    smooth = cv2.resize(mask.astype(np.float32), size, interpolation=cv2.INTER_LINEAR)
    return np.asarray(smooth >= 0.5)


def _window(mask: Mask, margin: int) -> tuple[slice, slice]:
    """Slices of the mask's bounding box with a margin, inside the picture."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if len(rows) == 0:
        return slice(0, mask.shape[0]), slice(0, mask.shape[1])
    return (
        slice(max(0, rows[0] - margin), rows[-1] + margin + 1),
        slice(max(0, columns[0] - margin), columns[-1] + margin + 1),
    )
