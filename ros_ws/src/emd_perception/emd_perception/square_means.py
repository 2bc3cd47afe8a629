"""Means over the squares of a grid on the table."""

from __future__ import annotations

from dataclasses import dataclass

import numba
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
    def of(
        cls, points_in_table: FloatArray, values: NDArray[np.uint8], side: float
    ) -> SquareMeans:
        """Average points over squares; the table frame's origin is a corner of four of them.

        Args:
            points_in_table: Shape (P, 3), metres; at least one point.
            values: What belongs to them, shape (P, K).
            side: Of the squares, metres.
        """
        bounds = np.empty((2, 2), dtype=np.int64)
        _find_bounds(points_in_table, side, bounds)
        rows, columns = bounds[1] - bounds[0] + 1
        all_counts = np.zeros(rows * columns, dtype=np.int64)
        all_totals = np.zeros((rows * columns, 4 + values.shape[1]))
        _add_up(points_in_table, values, side, bounds[0], columns, all_totals, all_counts)
        held = np.flatnonzero(all_counts)
        totals, counts = all_totals[held], all_counts[held]
        means = totals / counts[:, None]
        index = np.stack([held // columns, held % columns], axis=-1)
        spread = np.sqrt(np.maximum(means[:, 3] - means[:, 2] ** 2, 0.0))
        return cls(index, means[:, :3], means[:, 4:], counts, spread)

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
        count = np.empty(len(self), dtype=np.int64)
        _count_alike(heights, self.index, max_difference, count)
        return count


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _find_bounds(points: FloatArray, side: float, bounds: NDArray[np.int64]) -> None:
    """Find the lowest and the highest square that holds a point, along both axes."""
    scale = 1.0 / side
    for axis in range(2):
        low = high = points[0, axis]
        for point in range(len(points)):
            low, high = min(low, points[point, axis]), max(high, points[point, axis])
        bounds[0, axis], bounds[1, axis] = np.floor(low * scale), np.floor(high * scale)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _add_up(
    points: FloatArray,
    values: NDArray[np.uint8],
    side: float,
    lowest: NDArray[np.int64],
    columns: int,
    totals: FloatArray,
    counts: NDArray[np.int64],
) -> None:
    """Add coordinates, squared heights and values to those of each point's square."""
    scale = 1.0 / side  # a division takes several times as long
    for point in range(len(points)):
        row = np.int64(np.floor(points[point, 0] * scale)) - lowest[0]
        column = np.int64(np.floor(points[point, 1] * scale)) - lowest[1]
        square = row * columns + column
        counts[square] += 1
        for axis in range(3):
            totals[square, axis] += points[point, axis]
        totals[square, 3] += points[point, 2] * points[point, 2]
        for index in range(values.shape[1]):
            totals[square, 4 + index] += values[point, index]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _count_alike(
    heights: FloatArray, index: NDArray[np.int64], max_difference: float, count: NDArray[np.int64]
) -> None:
    """Count, for each square, those around it whose height differs little; NaN differs."""
    for square in range(len(index)):
        row, column = index[square, 0] + 1, index[square, 1] + 1
        alike = -1  # it is as high as itself
        for other_row in range(row - 1, row + 2):
            for other_column in range(column - 1, column + 2):
                difference = heights[other_row, other_column] - heights[row, column]
                alike += abs(difference) <= max_difference
        count[square] = alike
