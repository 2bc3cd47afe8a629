"""Tests of GraphCut itself, on a picture of two colours."""

import cv2
import numpy as np
import pytest

from emd_core.errors import NoClothError
from emd_perception.config import SegmentationConfig
from emd_perception.graph_cut import Seeds, cut, refine
from emd_perception.mask_morphology import dilate, erode, resize_mask
from emd_perception.table_appearance import lab_from_rgb

CONFIG = SegmentationConfig()
SHAPE = (240, 320)


def disc() -> tuple[np.ndarray, np.ndarray]:
    """A noisy blue disc on brown ground, and its true mask."""
    v, u = np.mgrid[: SHAPE[0], : SHAPE[1]]
    mask = (u - 170) ** 2 + (v - 110) ** 2 < 70**2
    colour = np.where(mask[..., None], (50, 80, 160), (190, 150, 110)).astype(float)
    colour += np.random.default_rng(0).normal(0, 12, colour.shape)
    return np.clip(colour, 0, 255).astype(np.uint8), mask


def reduced() -> tuple[np.ndarray, np.ndarray]:
    """The same at half size, in L*a*b*."""
    colour, mask = disc()
    half = (SHAPE[1] // 2, SHAPE[0] // 2)
    lab = lab_from_rgb(cv2.resize(colour, half, interpolation=cv2.INTER_AREA))
    return lab, resize_mask(mask, half[::-1])


def rough_seeds(mask: np.ndarray) -> Seeds:
    """Seeds that are wrong by several pixels along the outline."""
    nothing = np.zeros(mask.shape, bool)
    return Seeds(erode(mask, 17), nothing, ~dilate(mask, 25))


def test_the_cut_finds_the_outline_from_rough_seeds() -> None:
    """Seeds eight pixels off grow to the disc's true outline."""
    lab, truth = reduced()
    mask, _ = cut(lab, rough_seeds(truth), CONFIG)
    assert (mask & truth).sum() / (mask | truth).sum() > 0.98


def test_sure_seeds_stay() -> None:
    """What was surely cloth or surely not keeps its label whatever its colour."""
    lab, truth = reduced()
    sure_cloth, sure_not = np.zeros(truth.shape, bool), np.zeros(truth.shape, bool)
    sure_cloth[5:15, 5:15] = True
    sure_not[50:60, 80:90] = True
    mask, _ = cut(lab, Seeds(truth, sure_cloth, sure_not), CONFIG)
    assert mask[5:15, 5:15].all()
    assert not mask[50:60, 80:90].any()


def test_refinement_is_finer_than_the_reduced_mask() -> None:
    """At full resolution the outline is nearer the truth than the enlarged reduced mask."""
    colour, truth = disc()
    lab, small_truth = reduced()
    mask, mixtures = cut(lab, rough_seeds(small_truth), CONFIG)
    coarse = refine(colour, mask, mixtures, SegmentationConfig(refined_band=0))
    fine = refine(colour, mask, mixtures, CONFIG)
    assert fine.shape == truth.shape
    assert (fine ^ truth).sum() < (coarse ^ truth).sum()


def test_the_same_picture_is_cut_the_same_way() -> None:
    """GraphCut's clustering is seeded, whatever was drawn from OpenCV's generator before."""
    lab, truth = reduced()
    cv2.setRNGSeed(123)
    first, first_mixtures = cut(lab, rough_seeds(truth), CONFIG)
    cv2.setRNGSeed(456)
    second, second_mixtures = cut(lab, rough_seeds(truth), CONFIG)
    np.testing.assert_array_equal(first, second)
    np.testing.assert_array_equal(first_mixtures.cloth, second_mixtures.cloth)


def test_one_sided_seeds_are_refused() -> None:
    """A picture that is all cloth, or none, cannot be cut."""
    lab, truth = reduced()
    nothing, everything = np.zeros(truth.shape, bool), np.ones(truth.shape, bool)
    with pytest.raises(NoClothError, match="bare table"):
        cut(lab, Seeds(everything, nothing, nothing), CONFIG)
    with pytest.raises(NoClothError):
        cut(lab, Seeds(nothing, nothing, nothing), CONFIG)
