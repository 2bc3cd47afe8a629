"""Means over blocks of pixels: against OpenCV's and NumPy's."""

import cv2
import numpy as np
import pytest

from emd_perception.block_means import reduce_colour, reduce_known


@pytest.mark.parametrize("size", [(480, 640), (720, 1280), (333, 501), (120, 160)])
def test_colours_are_those_of_one_reduction_by_area(size: tuple[int, int]) -> None:
    """Halving first rounds once more: no level differs by more than one."""
    colour = np.random.default_rng(0).integers(0, 256, (*size, 3)).astype(np.uint8)
    found = reduce_colour(colour, (120, 160))
    wanted = cv2.resize(colour, (160, 120), interpolation=cv2.INTER_AREA)
    assert found.shape == (120, 160, 3)
    assert np.abs(found.astype(int) - wanted).max() <= 1


def test_unknown_pixels_are_left_out() -> None:
    """Sum over count is the mean of what is known, whole blocks without any have none."""
    image = np.random.default_rng(1).normal(size=(48, 64)).astype(np.float32)
    image[np.random.default_rng(2).random(image.shape) < 0.3] = np.nan
    image[:4, :4] = np.nan
    total, known = reduce_known(image, (12, 16))
    blocks = image.reshape(12, 4, 16, 4).swapaxes(1, 2).reshape(12, 16, 16)
    np.testing.assert_allclose(total, np.nansum(blocks, -1) / 16.0, atol=1e-6)
    np.testing.assert_allclose(known, np.isfinite(blocks).mean(-1), atol=1e-6)
    assert known[0, 0] == 0.0


def test_each_pixel_counts_once_whatever_the_sizes() -> None:
    """Blocks of unequal sizes cover the picture."""
    total, known = reduce_known(np.ones((50, 71), np.float32), (12, 16))
    np.testing.assert_allclose(total, 1.0, rtol=1e-6)
    np.testing.assert_allclose(known, 1.0, rtol=1e-6)
