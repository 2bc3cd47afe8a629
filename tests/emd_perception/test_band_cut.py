"""Tests of GraphCut in a band: against every labelling of a small picture."""

import itertools

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from emd_perception.band_cut import band_along, cut_band
from emd_perception.colour_mixtures import ColourMixtures


def mixture(means: np.ndarray, spread: float) -> np.ndarray:
    """Five components of equal weight and spherical spread, in grabCut's form."""
    covariances = np.tile(spread**2 * np.eye(3), (5, 1, 1))
    return np.concatenate([np.full(5, 0.2), means.ravel(), covariances.ravel()])[None]


def mixtures() -> ColourMixtures:
    """Dark cloth on a lighter table."""
    rng = np.random.default_rng(0)
    return ColourMixtures(
        mixture(rng.normal(140.0, 10.0, (5, 3)), 25.0),
        mixture(rng.normal(90.0, 10.0, (5, 3)), 25.0),
    )


def energy(picture: np.ndarray, mask: np.ndarray, band: np.ndarray, colours: ColourMixtures):
    """Gibbs energy of a labelling (Rother et al. 2004, equations 9 to 11), pair by pair."""
    odds = np.zeros(mask.shape)
    odds[band] = colours.log_odds(picture[band])
    total = -odds[mask & band].sum()
    values = picture.astype(float)
    pairs = []
    for row, column in np.argwhere(band):
        for down, right in itertools.product((-1, 0, 1), repeat=2):
            other = (row + down, column + right)
            inside = 0 <= other[0] < mask.shape[0] and 0 <= other[1] < mask.shape[1]
            if (down, right) != (0, 0) and inside:
                squared = ((values[row, column] - values[other]) ** 2).sum()
                cut = mask[row, column] != mask[other]
                # A pair inside the band is met from both ends.
                pairs.append((squared, cut, np.hypot(down, right), 0.5 if band[other] else 1.0))
    squared, cut, distance, share = np.array(pairs, dtype=float).T
    beta = 1.0 / (2.0 * squared.mean())
    return total + (share * cut * 50.0 * np.exp(-beta * squared) / distance).sum()


@pytest.mark.parametrize("seed", range(6))
def test_no_labelling_of_the_band_has_less_energy(seed: int) -> None:
    """Of all 512 labellings of a band of nine pixels the cut has the least energy."""
    rng = np.random.default_rng(seed)
    picture = rng.integers(60, 170, (5, 5, 3)).astype(np.uint8)
    inside = np.zeros((5, 5), bool)
    inside[:, :2] = True
    band = np.zeros((5, 5), bool)
    band[1:4, 1:4] = True
    found = cut_band(picture, inside, band, mixtures())
    best = np.inf
    for labels in itertools.product((False, True), repeat=9):
        mask = inside.copy()
        mask[band] = labels
        best = min(best, energy(picture, mask, band, mixtures()))
    assert energy(picture, found, band, mixtures()) == pytest.approx(best, abs=0.5)
    np.testing.assert_array_equal(found[~band], inside[~band])


def test_a_band_at_the_pictures_border_is_cut_too() -> None:
    """A cloth that fills half of the picture up to three borders keeps to its colour."""
    truth = np.zeros((30, 40), bool)
    truth[:, :17] = True
    colours = np.where(truth[..., None], 90, 140) + np.random.default_rng(1).normal(
        0, 6, (30, 40, 3)
    )
    guess = np.zeros_like(truth)
    guess[:, :20] = True
    picture = np.clip(colours, 0, 255).astype(np.uint8)
    found = cut_band(picture, guess, band_along(guess, 5), mixtures())
    np.testing.assert_array_equal(found, truth)


def test_log_odds_are_those_of_the_mixtures() -> None:
    """Against SciPy's normal densities."""
    colours = np.random.default_rng(2).integers(60, 170, (50, 3)).astype(np.uint8)
    known = mixtures()
    logs = []
    for side in (known.cloth, known.background):
        means = side[0, 5:20].reshape(5, 3)
        logs.append(np.log(sum(0.2 * multivariate_normal(m, 625.0).pdf(colours) for m in means)))
    np.testing.assert_allclose(known.log_odds(colours), logs[0] - logs[1], atol=1e-3)
