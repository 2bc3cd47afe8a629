"""Means over the squares of a grid on the table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emd_core.frames import FloatArray


@dataclass(frozen=True)
class SquareMeans:
    """Points averaged over squares on the table; only squares that hold points are listed.

    Attributes:
        index: Of the squares, shape (N, 2), counted from the lowest one.
        points: Mean points, shape (N, 3), metres, table frame.
        values: Means of what belongs to the points, shape (N, K).
        counts: Points in each square, shape (N,).
        spread: Standard deviation of the heights within each square, shape (N,), metres.
    """

    index: NDArray[np.int64]
    points: FloatArray
    values: FloatArray
    counts: NDArray[np.int64]
    spread: FloatArray

    @classmethod
    def of(cls, points_in_table: FloatArray, values: NDArray[Any], side: float) -> SquareMeans:
        """Average points over squares; the table frame's origin is a corner of four of them.

        Args:
            points_in_table: Shape (P, 3), metres; at least one point.
            values: What belongs to them, shape (P, K).
            side: Of the squares, metres.
        """
        place = np.floor(points_in_table[:, :2] / side).astype(np.int64)
        place -= place.min(axis=0)
        columns = int(place[:, 1].max()) + 1
        flat = place[:, 0] * columns + place[:, 1]
        counts = np.bincount(flat)
        held = np.flatnonzero(counts)
        rows = [*points_in_table.T, points_in_table[:, 2] ** 2, *values.T]
        totals = np.stack([np.bincount(flat, weights=row)[held] for row in rows], axis=-1)
        means = totals / counts[held, None]
        index = np.stack([held // columns, held % columns], axis=-1)
        spread = np.sqrt(np.maximum(means[:, 3] - means[:, 2] ** 2, 0.0))
        return cls(index, means[:, :3], means[:, 4:], counts[held], spread)

    def __len__(self) -> int:
        """Squares that hold points."""
        return len(self.index)

    def alike_beside(self, max_difference: float) -> NDArray[np.int64]:
        """Count those of the eight squares around each whose height differs little.

        Args:
            max_difference: Of height, metres.

        Returns:
            Shape (N,), 0..8.
        """
        shape = self.index.max(axis=0) + 3
        heights = np.full(shape, np.nan)
        row, column = self.index.T + 1
        heights[row, column] = self.points[:, 2]
        count = np.zeros(len(self), dtype=np.int64)
        for down in (-1, 0, 1):
            for right in (-1, 0, 1):
                beside = heights[row + down, column + right]
                count += np.abs(beside - self.points[:, 2]) <= max_difference
        return count - 1  # each is as high as itself
