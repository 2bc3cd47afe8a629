"""How many layers of cloth lie in each column, told from its height."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView, FloatArray

_REACH = 2  # columns around each that vote


def count_layers(
    points_in_table: FloatArray, thickness: float, field_of_view: FieldOfView | None = None
) -> NDArray[np.int64]:
    """Count the layers of a folded cloth of known thickness, column by column.

    Each column's mean height says a number. Near a crease the layers gape, so that a height says
    one too many; a column therefore takes the number that most of the columns around it say.
    Towels lie folded in areas wider than that, a crumpled cloth does not: its numbers are only
    heights.

    Args:
        points_in_table: The cloth's surface, shape (N, 3), metres.
        thickness: Of one layer, metres.
        field_of_view: Box and columns; the default one if None.

    Returns:
        Shape (X, Y); 0 where no point lies.

    Raises:
        InvalidInputError: If the thickness is not positive and finite.
    """
    if not (math.isfinite(thickness) and thickness > 0.0):
        raise InvalidInputError(
            f"the thickness of a layer must be positive and finite, got {thickness}; measure it"
        )
    fov = field_of_view or FieldOfView()
    height = _mean_heights(points_in_table, fov)
    held = np.isfinite(height)
    said = np.where(held, np.maximum(np.rint(np.nan_to_num(height) / thickness), 1.0), 0.0)
    return _most_frequent_around(said.astype(np.int64), held)


def _mean_heights(points_in_table: FloatArray, field_of_view: FieldOfView) -> FloatArray:
    """Mean height of the points in each column, shape (X, Y), metres; NaN without any."""
    size = np.array(field_of_view.size[:2])
    index = np.floor(
        (points_in_table[:, :2] - field_of_view.origin[:2]) / field_of_view.resolution[:2]
    )
    wrapped = index.astype(np.int64) % size
    flat = wrapped[:, 0] * size[1] + wrapped[:, 1]
    count = np.bincount(flat, minlength=int(size.prod()))
    total = np.bincount(flat, weights=points_in_table[:, 2], minlength=int(size.prod()))
    mean = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    return np.asarray(mean.reshape(size))


def _most_frequent_around(said: NDArray[np.int64], held: NDArray[np.bool_]) -> NDArray[np.int64]:
    """The number said most often in the square around each held column; its own if even."""
    votes = np.zeros((int(said.max()) + 1, *said.shape))
    for number in range(1, len(votes)):
        padded = np.pad((said == number).astype(float), _REACH)
        windows = np.lib.stride_tricks.sliding_window_view(padded, (2 * _REACH + 1,) * 2)
        votes[number] = windows.sum(axis=(2, 3))
    np.put_along_axis(votes, said[None], np.take_along_axis(votes, said[None], 0) + 0.5, axis=0)
    return np.where(held, votes.argmax(axis=0), 0)
