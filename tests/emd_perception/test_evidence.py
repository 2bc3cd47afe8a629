"""What heights say about being cloth."""

from __future__ import annotations

import numpy as np
import pytest

from emd_perception.evidence import height_contrast


@pytest.mark.parametrize("noise", [0.0001, 0.001])
def test_cloth_stands_out_from_a_table_that_the_sensor_bends(noise: float) -> None:
    """3 mm above a plane that is measured bent by 8 mm, in spreads of the noise."""
    v, u = np.meshgrid(np.linspace(-1, 1, 120), np.linspace(-1, 1, 160), indexing="ij")
    rng = np.random.default_rng(0)
    height = 0.008 * (u * u - 0.5 * u * v) + rng.normal(0.0, noise, u.shape)
    cloth = (np.abs(u) < 0.4) & (np.abs(v) < 0.4)
    height[cloth] += 0.003
    height[:4] = np.nan
    bare = np.zeros(u.shape, dtype=bool)
    bare[:25], bare[-25:] = True, True
    contrast, spread = height_contrast(height.astype(np.float32), bare, 0.0006)
    assert spread == pytest.approx(max(noise, 0.0006), rel=0.15)
    wanted = 0.003 / max(noise, 0.0006)
    assert np.median(contrast[cloth]) == pytest.approx(wanted, rel=0.15)
    assert np.median(contrast[~cloth]) < 1.0
    assert (contrast[:4] == 0.0).all()


def test_without_bare_table_in_view_what_lies_near_the_plane_is_taken() -> None:
    """A few pixels of table are not enough to learn from."""
    height = np.zeros((60, 80), dtype=np.float32)
    height[20:40, 30:50] = 0.02
    contrast, _ = height_contrast(height, np.zeros(height.shape, dtype=bool), 0.0006)
    assert contrast[30, 40] > 5.0 and contrast[5, 5] == 0.0
