"""Folds that a cloth's outline suggests, as starts of a search (ours).

People fold along the smallest rectangle around a cloth: a corner to the opposite corner or to the
middle, a side to the opposite side, to the middle or to a third.
"""

from __future__ import annotations

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

_CORNER_SHARES = (1.0, 0.5)  # of the way to the opposite corner
_SIDE_SHARES = (1.0, 2.0 / 3.0, 0.5)  # of the way to the opposite side


def outline_folds(silhouette: Tensor) -> Tensor:
    """Give folds along the smallest rectangle around a silhouette.

    Args:
        silhouette: Boolean, shape (X, Y), X = Y, wrapped.

    Returns:
        Manipulations, normalised, shape (20, 6), first those of one hand, whose second point is
        NaN; shape (0, 6) if there is no cloth.
    """
    corners = _corners(silhouette.cpu().numpy())
    if corners is None:
        return torch.zeros(0, 6)
    nowhere, folds = np.full(2, np.nan), []
    for share in _CORNER_SHARES:
        for i in range(4):
            way = share * (corners[(i + 2) % 4] - corners[i])
            folds.append(np.concatenate([corners[i], nowhere, way]))
    for share in _SIDE_SHARES:
        for i in range(4):
            way = share * (corners[(i + 3) % 4] - corners[i])
            folds.append(np.concatenate([corners[i], corners[(i + 1) % 4], way]))
    values = np.stack(folds)
    values[:, :4] = (values[:, :4] + 1.0) % 2.0 - 1.0
    return torch.from_numpy(values).float()


def _corners(silhouette: NDArray[np.bool_]) -> NDArray[np.float64] | None:
    """Corners (4, 2) in order, normalised, of the smallest rectangle around the columns' middles.

    A cloth that wraps is first moved to where the fewest columns are on the rim.
    """
    if not silhouette.any():
        return None
    count = len(silhouette)
    shift = np.array([silhouette.sum(axis=1 - axis).argmin() for axis in (0, 1)])
    moved = np.roll(silhouette, -shift, axis=(0, 1))
    rectangle = cv2.minAreaRect(np.argwhere(moved).astype(np.float32))
    corners = cv2.boxPoints(rectangle).astype(np.float64) + shift
    return (corners + 0.5) * (2.0 / count) - 1.0
