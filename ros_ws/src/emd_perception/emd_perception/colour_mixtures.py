"""The colour mixtures of cloth and background that a cut has learnt."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_COMPONENTS = 5  # of each side, as grabCut has them
_LEAST_DENSITY = 1e-30  # so that a colour unlike both sides prefers neither


@dataclass(frozen=True)
class ColourMixtures:
    """The normal mixtures of both sides, in grabCut's own form, shape (1, 65) each.

    65 values: five weights, five means of three channels, five 3 x 3 covariances.
    """

    background: NDArray[np.float64]
    cloth: NDArray[np.float64]

    def log_odds(self, colours: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Logarithm of how much likelier each colour is on the cloth than beside it.

        Args:
            colours: Shape (N, 3), the channels that the mixtures were learnt in.

        Returns:
            Shape (N,); positive for the cloth's colours.
        """
        values = colours.astype(np.float32)
        cloth, background = (_density(values, side) for side in (self.cloth, self.background))
        return np.asarray(np.log(cloth + _LEAST_DENSITY) - np.log(background + _LEAST_DENSITY))


def _density(colours: NDArray[np.float32], mixture: NDArray[np.float64]) -> NDArray[np.float32]:
    """Density of a mixture, up to a factor that all mixtures share, shape (N,)."""
    weights, means, covariances = np.split(
        mixture.ravel(), (_COMPONENTS, _COMPONENTS + 3 * _COMPONENTS)
    )
    density = np.zeros(len(colours), dtype=np.float32)
    for weight, mean, covariance in zip(
        weights, means.reshape(-1, 3), covariances.reshape(-1, 3, 3), strict=True
    ):
        if weight <= 0.0:
            continue
        whitening = np.linalg.inv(np.linalg.cholesky(covariance)).astype(np.float32)
        white = (colours - mean.astype(np.float32)) @ whitening.T
        squared = np.einsum("ni,ni->n", white, white)
        density += np.float32(weight * np.linalg.det(whitening)) * np.exp(-0.5 * squared)
    return density
