"""Robust fits of trends, on samples whose trend and spread are known."""

import numpy as np

from emd_perception.table_appearance import trend_basis
from emd_perception.trend_fit import TERMS, fit_colours, fit_heights

BASIS = trend_basis((40, 50)).reshape(-1, TERMS).astype(np.float64)
FLOOR = np.array([0.5, 0.5, 0.5])


def test_heights_are_fitted_without_what_lies_off_them() -> None:
    """A fifth of the samples lie on a cloth of 5 mm; trend and spread are those of the table."""
    rng = np.random.default_rng(0)
    trend = np.array([0.001, 0.002, -0.001, 0.001, 0.0005, -0.001])
    heights = BASIS @ trend + rng.normal(0.0, 0.0007, len(BASIS))
    heights[rng.random(len(heights)) < 0.2] += 0.005
    found, spread = fit_heights(heights, BASIS, 0.0002, 0.012, 50)
    np.testing.assert_allclose(BASIS @ found, BASIS @ trend, atol=0.0004)
    assert 0.0006 < spread < 0.0009


def test_too_few_heights_are_not_fitted() -> None:
    """With fewer than asked for the trend stays level and the spread what was assumed."""
    trend, spread = fit_heights(np.full(9, 0.001), BASIS[:9].copy(), 0.0002, 0.012, 50)
    assert not trend.any() and spread == 0.012


def test_colours_are_fitted_without_another_things() -> None:
    """A quarter of the samples are of a cloth; trend and covariance are those of the table."""
    rng = np.random.default_rng(1)
    trend = np.zeros((TERMS, 3))
    trend[0], trend[1], trend[3] = (65.0, 9.0, 28.0), (6.0, 0.5, -1.0), (-5.0, 0.0, 1.0)
    spread = np.array([[4.0, 1.0, 0.0], [1.0, 2.0, 0.0], [0.0, 0.0, 1.0]])
    colours = BASIS @ trend + rng.multivariate_normal(np.zeros(3), spread, len(BASIS))
    colours[rng.random(len(colours)) < 0.25] = (90.0, 0.0, 2.0)
    found, covariance = fit_colours(colours, BASIS, FLOOR)
    assert np.abs(BASIS @ (found - trend)).max() < 1.5
    ratio = np.linalg.eigvals(np.linalg.solve(spread, covariance)).real
    assert 0.6 < ratio.min() and ratio.max() < 1.7


def test_a_table_of_one_colour_has_the_least_spread() -> None:
    """All samples are as near as each other: all count, and nothing is divided by zero."""
    colours = np.tile([50.0, 1.0, 2.0], (len(BASIS), 1))
    found, covariance = fit_colours(colours, BASIS, FLOOR)
    np.testing.assert_allclose(BASIS @ found, colours, atol=1e-9)
    np.testing.assert_allclose(covariance, np.diag(FLOOR**2), atol=1e-9)
