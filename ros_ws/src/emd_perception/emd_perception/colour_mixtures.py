"""The colour mixtures of cloth and background that a cut has learnt."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numba
import numpy as np
from numpy.typing import NDArray

_COMPONENTS = 5  # of each side, as grabCut has them
_LEAST_DENSITY = 1e-30  # so that a colour unlike both sides prefers neither
_FAR = 160.0  # squared spreads, at which a density is as good as none beside the least one


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
        odds = np.empty(len(colours), dtype=np.float32)
        _fill_log_odds(np.ascontiguousarray(colours), *self._whitened, odds)
        return odds

    @cached_property
    def _whitened(
        self,
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        """What turns colours into whitened ones of all ten components, cloth's first.

        Returns:
            Matrices (10, 3, 3), offsets (10, 3), and weight of each component's density (10,).
        """
        matrix, offset = np.zeros((2 * _COMPONENTS, 3, 3)), np.zeros((2 * _COMPONENTS, 3))
        weights = np.zeros(2 * _COMPONENTS)
        for index, (weight, mean, covariance) in enumerate(
            [*_components(self.cloth), *_components(self.background)]
        ):
            if weight <= 0.0:
                continue
            whitening = np.linalg.inv(np.linalg.cholesky(covariance))
            matrix[index], offset[index] = whitening, whitening @ mean
            weights[index] = weight * np.linalg.det(whitening)
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


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _fill_log_odds(
    colours: NDArray[np.uint8],
    whitening: NDArray[np.float32],
    offset: NDArray[np.float32],
    weight: NDArray[np.float32],
    odds: NDArray[np.float32],
) -> None:
    density = np.empty(2, dtype=np.float32)
    for pixel in range(len(colours)):
        density[:] = _LEAST_DENSITY
        for component in range(len(weight)):
            if weight[component] <= 0.0:
                continue
            squared = np.float32(0.0)
            for axis in range(3):
                white = -offset[component, axis]
                for channel in range(3):
                    level = np.float32(colours[pixel, channel])
                    white += whitening[component, axis, channel] * level
                squared += white * white
            if squared < _FAR:
                near = np.exp(np.float32(-0.5) * squared)
                density[component // _COMPONENTS] += weight[component] * near
        odds[pixel] = np.log(density[0]) - np.log(density[1])
