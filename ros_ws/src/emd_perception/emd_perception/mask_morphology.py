"""OpenCV's morphology and connected components on boolean masks."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from emd_perception.image_types import Mask


def dilate(mask: Mask, side: int) -> Mask:
    """Grow a mask by a square of `side` pixels."""
    return np.asarray(cv2.dilate(mask.astype(np.uint8), _square(side)), dtype=np.bool_)


def erode(mask: Mask, side: int, outside: bool = False) -> Mask:
    """Shrink a mask by a square of `side` pixels; `outside` says what lies beyond the picture."""
    pixels = mask.astype(np.uint8)
    border = int(outside)
    shrunk = cv2.erode(
        pixels, _square(side), borderType=cv2.BORDER_CONSTANT, borderValue=(border,)
    )
    return np.asarray(shrunk, dtype=np.bool_)


def opened(mask: Mask, side: int) -> Mask:
    """Remove what is narrower than `side` pixels."""
    pixels = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, _square(side))
    return np.asarray(pixels, dtype=np.bool_)


def label_components(mask: Mask, connectivity: int = 8) -> tuple[int, NDArray[np.int32]]:
    """Number the connected pieces of a mask.

    Returns:
        Count of labels, background 0 included, and the label of each pixel, shape (H, W).
    """
    count, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=connectivity)
    return count, np.asarray(labels, dtype=np.int32)


def convex_hull(mask: Mask) -> Mask:
    """The convex hull of a mask's pixels; empty if the mask is."""
    hull = np.zeros(mask.shape, dtype=np.uint8)
    if mask.any():
        # Only the outline's pixels can be corners; the inner ones would cost 8 ms.
        points = cv2.findNonZero((mask & ~erode(mask, 3)).astype(np.uint8))
        cv2.fillConvexPoly(hull, cv2.convexHull(points), (1,))
    return hull.astype(np.bool_)


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
    pixels = cv2.resize(mask.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)
    return np.asarray(pixels, dtype=np.bool_)


def _square(side: int) -> NDArray[np.uint8]:
    return np.ones((side, side), dtype=np.uint8)
