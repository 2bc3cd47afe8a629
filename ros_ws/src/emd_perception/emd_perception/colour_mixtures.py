"""The colour mixtures of cloth and background that a cut has learnt."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

_COMPONENTS = 5  # of each side, as grabCut has them
_LEAST_DENSITY = 1e-30  # so that a colour unlike both sides prefers neither
_SUM_OF_THREE = np.kron(np.eye(2 * _COMPONENTS), np.ones((3, 1))).astype(np.float32)


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
        cloth, background = self._densities(colours.astype(np.float32))
        return np.asarray(np.log(cloth + _LEAST_DENSITY) - np.log(background + _LEAST_DENSITY))

    def _densities(
        self, colours: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Densities of both sides, up to a factor that they share, shape (N,) each."""
        whitening, offset, weight = self._whitened
        white = colours @ whitening
        white -= offset
        np.square(white, out=white)
        squared = white @ _SUM_OF_THREE
        squared *= np.float32(-0.5)
        density = np.exp(squared, out=squared) @ weight
        return density[:, 0], density[:, 1]

    @cached_property
    def _whitened(
        self,
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        """What turns colours into whitened ones of all ten components, cloth's first.

        Returns:
            Matrix (3, 30), offset (30,), and weight of each component's density for both sides
            (10, 2).
        """
        matrix, offset = np.zeros((3, 30)), np.zeros(30)
        weights = np.zeros((2 * _COMPONENTS, 2))
        for index, (weight, mean, covariance) in enumerate(
            [*_components(self.cloth), *_components(self.background)]
        ):
            if weight <= 0.0:
                continue
            whitening = np.linalg.inv(np.linalg.cholesky(covariance))
            place = slice(3 * index, 3 * index + 3)
            matrix[:, place], offset[place] = whitening.T, whitening @ mean
            weights[index, index // _COMPONENTS] = weight * np.linalg.det(whitening)
        whole, shift, share = (one.astype(np.float32) for one in (matrix, offset, weights))
        return whole, shift, share


def _components(
    mixture: NDArray[np.float64],
) -> list[tuple[float, NDArray[np.float64], NDArray[np.float64]]]:
    """Weight, mean (3,) and covariance (3, 3) of each component."""
    weights, means, covariances = np.split(
        mixture.ravel(), (_COMPONENTS, _COMPONENTS + 3 * _COMPONENTS)
    )
    return list(
        zip(weights.tolist(), means.reshape(-1, 3), covariances.reshape(-1, 3, 3), strict=True)
    )
