"""Tests of the table's learnt colour."""

import numpy as np

from emd_perception.config import SegmentationConfig
from emd_perception.table_appearance import (
    colour_contrast,
    learn_table_appearance,
    region_rim,
    smooth_height,
)

SHAPE = (120, 160)
CONFIG = SegmentationConfig()
RIM = region_rim(np.ones(SHAPE, bool), CONFIG.border_share)


def table(seed: int = 0) -> np.ndarray:
    """A light brown table with some grain, L*a*b*."""
    rng = np.random.default_rng(seed)
    return (np.array([65.0, 9.0, 28.0]) + rng.normal(0, 1, (*SHAPE, 3))).astype(np.float32)


def with_cloth(lab: np.ndarray, rows: slice, columns: slice) -> np.ndarray:
    """Lay a white cloth on a copy of the table."""
    covered = lab.copy()
    covered[rows, columns] = np.array([90.0, 0.0, 2.0])
    return covered


def test_cloth_is_far_from_the_table_and_the_table_is_not() -> None:
    """The cloth's contrast is many spreads, the table's stays below the threshold."""
    lab = with_cloth(table(), slice(30, 90), slice(40, 120))
    contrast = colour_contrast(lab, learn_table_appearance(lab, RIM, CONFIG))
    assert contrast[30:90, 40:120].min() > 8.0
    assert np.quantile(contrast[:25], 0.99) < CONFIG.min_contrast


def test_a_cloth_that_reaches_into_the_rim_is_not_learnt() -> None:
    """Cloth over a third of the picture and two of its borders is still told from the table."""
    lab = with_cloth(table(), slice(0, 60), slice(50, 160))
    contrast = colour_contrast(lab, learn_table_appearance(lab, RIM, CONFIG))
    assert np.quantile(contrast[:60, 50:], 0.01) > CONFIG.max_contrast
    assert np.quantile(contrast[70:], 0.99) < CONFIG.min_contrast


def test_light_that_fades_across_the_table_is_no_contrast() -> None:
    """A lamp that changes L*, a* and b* smoothly by a half leaves the table's contrast small."""
    v, u = np.mgrid[-1 : 1 : SHAPE[0] * 1j, -1 : 1 : SHAPE[1] * 1j]
    light = 1.0 - 0.25 * (u**2 + v**2) + 0.1 * u
    lab = (table() * light[..., None]).astype(np.float32)
    contrast = colour_contrast(lab, learn_table_appearance(lab, RIM, CONFIG))
    assert np.quantile(contrast, 0.999) < CONFIG.min_contrast


def test_no_table_in_view_is_said() -> None:
    """Without candidates there is nothing to learn from."""
    assert learn_table_appearance(table(), np.zeros(SHAPE, bool), CONFIG) is None


def test_the_rim_is_the_outer_share_of_a_region() -> None:
    """The rim holds about its share of the pixels, and none from the middle."""
    region = np.zeros(SHAPE, bool)
    region[10:110, 20:140] = True
    rim = region_rim(region, 0.5)
    assert not (rim & ~region).any()
    assert 0.45 < rim.sum() / region.sum() < 0.6
    assert not rim[50:70, 60:100].any()
    assert rim[10, 20:140].all()


def test_smoothing_heights_leaves_unknown_pixels_out() -> None:
    """A mean over known neighbours only; far from all of them it stays unknown."""
    height = np.full((20, 20), 0.01, np.float32)
    height[5, 5] = np.nan
    height[10:, 10:] = np.nan
    smooth = smooth_height(height)
    np.testing.assert_allclose(smooth[5, 5], 0.01, rtol=1e-5)
    assert np.isnan(smooth[15:, 15:]).all()
