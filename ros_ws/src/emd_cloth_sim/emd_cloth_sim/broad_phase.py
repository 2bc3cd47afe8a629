"""A grid of cells to find what is near what, and the lists of pairs that may touch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from emd_core.frames import FloatArray

GRID_CELLS = 60_000


class Cells(NamedTuple):
    """Items (triangles or edges) sorted into cells; working memory of the searches.

    Attributes:
        points: Centre of each item, shape (N, 3), metres.
        cell_of: Cell of each item, shape (N,).
        order: Items by cell, shape (N,).
        first: Place in `order` of each cell's first item, shape (C + 1,).
        boxes: Bounding boxes in that order: low x, high x, low y ..., shape (N, 6), metres.
    """

    points: FloatArray
    cell_of: NDArray[np.int64]
    order: NDArray[np.int64]
    first: NDArray[np.int64]
    boxes: FloatArray


class Candidates(NamedTuple):
    """Pairs that may touch before the next search, all of shape (M,).

    Attributes:
        one: Vertex, or first edge, of a pair.
        other: Triangle, or second edge.
        side: Side of the second on which the first is, 1 or -1.
        wake: The pair sleeps until the cloth has travelled this far since the search, metres;
            -1 for a pair in contact.
    """

    one: NDArray[np.int32]
    other: NDArray[np.int32]
    side: FloatArray
    wake: FloatArray


def allocate_cells(count: int) -> Cells:
    """Make working memory for `count` items."""
    return Cells(
        np.empty((count, 3)),
        np.empty(count, np.int64),
        np.empty(count, np.int64),
        np.empty(GRID_CELLS, np.int64),
        np.empty((count, 6)),
    )


def allocate_candidates(size: int) -> Candidates:
    """Make lists for `size` pairs."""
    return Candidates(
        np.empty(size, np.int32), np.empty(size, np.int32), np.empty(size), np.empty(size)
    )


@njit(cache=True)
def sort_into_cells(cells: Cells, cell: float) -> tuple:
    """Sort `cells.points` into a dense grid of cells at least `cell` wide (counting sort).

    Returns the lowest corner, the width and the counts of cells.
    """
    points, cell_of, order, first = cells.points, cells.cell_of, cells.order, cells.first
    low = np.empty(3)
    count = np.empty(3, dtype=np.int64)
    for k in range(3):
        low[k] = points[:, k].min()
    while True:
        total = 1
        for k in range(3):
            count[k] = int((points[:, k].max() - low[k]) / cell) + 1
            total *= count[k]
        if total < first.shape[0]:
            break
        cell *= 1.3
    first[: total + 1] = 0
    for n in range(points.shape[0]):
        i = int((points[n, 0] - low[0]) / cell)
        j = int((points[n, 1] - low[1]) / cell)
        k = int((points[n, 2] - low[2]) / cell)
        cell_of[n] = (i * count[1] + j) * count[2] + k
        first[cell_of[n] + 1] += 1
    for c in range(total):
        first[c + 1] += first[c]
    for n in range(points.shape[0] - 1, -1, -1):
        c = cell_of[n] + 1
        first[c] -= 1
        order[first[c]] = n
    # After the backward fill `first[c + 1]` is the start of cell c; shift back by one cell.
    for c in range(total):
        first[c] = first[c + 1]
    first[total] = points.shape[0]
    return low, cell, count


@njit(cache=True)
def fill_boxes(position: FloatArray, items: NDArray[np.int32], pad: float, cells: Cells) -> None:
    """Bounding boxes of items, given by their vertices, grown by `pad`, in the cells' order."""
    boxes = cells.boxes
    for n in range(items.shape[0]):
        item = cells.order[n]
        for k in range(3):
            low = high = position[items[item, 0], k]
            for corner in range(1, items.shape[1]):
                low = min(low, position[items[item, corner], k])
                high = max(high, position[items[item, corner], k])
            boxes[n, 2 * k] = low - pad
            boxes[n, 2 * k + 1] = high + pad
