"""OpenCV's morphology and connected components on boolean masks."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from emd_core.frames import FloatArray
from emd_perception.image_types import FloatImage, Mask


def dilate(mask: Mask, side: int) -> Mask:
    """Grow a mask by a square of `side` pixels."""
    return _mask(cv2.dilate(_pixels(mask), _square(side)))


def erode(mask: Mask, side: int, outside: bool = False) -> Mask:
    """Shrink a mask by a square of `side` pixels; `outside` says what lies beyond the picture."""
    pixels = _pixels(mask)
    border = int(outside)
    shrunk = cv2.erode(
        pixels, _square(side), borderType=cv2.BORDER_CONSTANT, borderValue=(border,)
    )
    return _mask(shrunk)


def opened(mask: Mask, side: int) -> Mask:
    """Remove what is narrower than `side` pixels."""
    pixels = cv2.morphologyEx(_pixels(mask), cv2.MORPH_OPEN, _square(side))
    return _mask(pixels)


def label_components(mask: Mask, connectivity: int = 8) -> tuple[int, NDArray[np.int32]]:
    """Number the connected pieces of a mask.

    Returns:
        Count of labels, background 0 included, and the label of each pixel, shape (H, W).
    """
    count, labels = cv2.connectedComponents(_pixels(mask), connectivity=connectivity)
    return count, np.asarray(labels, dtype=np.int32)


def component_sums(
    labels: NDArray[np.int32], count: int, weights: FloatImage, marked: Mask
) -> tuple[FloatArray, NDArray[np.int64]]:
    """Sum up, for each label, the weights of its pixels, and count those that are marked.

    Args:
        labels: Shape (H, W), below `count`.
        count: How many labels there are.
        weights: Shape (H, W).
        marked: Shape (H, W).

    Returns:
        Sums and counts, shape (count,) each.
    """
    sums, counts = np.zeros(count), np.zeros(count, dtype=np.int64)
    _add_components(
        np.ascontiguousarray(labels),
        np.ascontiguousarray(weights),
        np.ascontiguousarray(marked),
        sums,
        counts,
    )
    return sums, counts


def convex_hull(mask: Mask) -> Mask:
    """The convex hull of a mask's pixels; empty if the mask is."""
    hull = np.zeros(mask.shape, dtype=np.uint8)
    # Only the first and the last pixel of a row can be corners.
    ends = np.empty((2 * mask.shape[0], 2), dtype=np.int32)
    count = _row_ends(np.ascontiguousarray(mask), ends)
    if count > 0:
        cv2.fillConvexPoly(hull, cv2.convexHull(ends[:count]), (1,))
    return _mask(hull)


def bounding_window(mask: Mask, margin: int) -> tuple[slice, slice]:
    """Slices of the mask's bounding box with a margin, inside the picture; all of it if empty."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if len(rows) == 0:
        return slice(0, mask.shape[0]), slice(0, mask.shape[1])
    return (
        slice(max(0, rows[0] - margin), rows[-1] + margin + 1),
        slice(max(0, columns[0] - margin), columns[-1] + margin + 1),
    )


def resize_mask(mask: Mask, shape: tuple[int, ...]) -> Mask:
    """Resize a mask to `shape` (rows, columns) by the nearest pixel."""
    size = (shape[1], shape[0])
    pixels = cv2.resize(_pixels(mask), size, interpolation=cv2.INTER_NEAREST)
    return _mask(pixels)


@lru_cache(maxsize=16)
def _square(side: int) -> NDArray[np.uint8]:
    square = np.ones((side, side), dtype=np.uint8)
    square.flags.writeable = False  # all callers share it
    return square


def _pixels(mask: Mask) -> NDArray[np.uint8]:
    """The same memory as OpenCV takes it."""
    return np.ascontiguousarray(mask).view(np.uint8)


def _mask(pixels: object) -> Mask:
    """The same memory, zeros and ones, as a mask."""
    return np.asarray(pixels).view(np.bool_)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _add_components(
    labels: NDArray[np.int32],
    weights: FloatImage,
    marked: Mask,
    sums: FloatArray,
    counts: NDArray[np.int64],
) -> None:
    for row in range(labels.shape[0]):
        label, total, count = labels[row, 0], 0.0, 0  # of the run of equal labels up to here
        for column in range(labels.shape[1]):
            if labels[row, column] != label:
                sums[label] += total
                counts[label] += count
                label, total, count = labels[row, column], 0.0, 0
            total += weights[row, column]
            count += marked[row, column]
        sums[label] += total
        counts[label] += count


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _row_ends(mask: Mask, ends: NDArray[np.int32]) -> int:
    """List column and row of the first and the last pixel of each row; give their number."""
    width, count = mask.shape[1], 0
    for row in range(mask.shape[0]):
        first = 0
        while first < width and not mask[row, first]:
            first += 1
        if first == width:
            continue
        last = width - 1
        while not mask[row, last]:
            last -= 1
        ends[count, 0], ends[count, 1] = first, row
        ends[count + 1, 0], ends[count + 1, 1] = last, row
        count += 2
    return count
