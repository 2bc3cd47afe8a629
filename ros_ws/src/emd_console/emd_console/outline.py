"""The outlines of what perception took for cloth."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Polygon = list[list[int]]


def mask_outlines(
    mask: NDArray[np.uint8], tolerance: float = 1.5, smallest: float = 60.0
) -> list[Polygon]:
    """Trace a mask's pieces and holes as polygons.

    Args:
        mask: Shape (H, W); cloth where it is not 0.
        tolerance: How far a polygon may pass beside the edge, pixels.
        smallest: Pieces of a smaller area are left out, square pixels.

    Returns:
        Polygons of pixels (column, row), the largest first.
    """
    found: Any = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)[0]
    kept = [contour for contour in found if cv2.contourArea(contour) >= smallest]
    kept.sort(key=cv2.contourArea, reverse=True)
    return [cv2.approxPolyDP(contour, tolerance, True)[:, 0].tolist() for contour in kept]
