"""The silhouette of what perception saw, rasterised finer than the network's voxels."""

from __future__ import annotations

import cv2
import numpy as np

from emd_arm_executor.silhouette import Silhouette
from emd_core.errors import NoClothError
from emd_core.frames import FloatArray


def silhouette_from_points(points_in_table: FloatArray, cell: float = 0.005) -> Silhouette:
    """Rasterise points of the cloth's upper surface.

    Cells between the points are closed, so that a cloud thinned to about the cells' size gives one
    piece; a gap wider than two cells stays a gap.

    Args:
        points_in_table: Shape (N, 3), metres, table frame.
        cell: Edge length of a cell, metres.

    Raises:
        NoClothError: If there are no points.
    """
    points = np.asarray(points_in_table, dtype=np.float64)
    if points.size == 0:
        raise NoClothError("the last observation holds no points of a cloth; look again")
    margin = 3  # cells around the cloth, which the closing needs
    origin = np.floor(points[:, :2].min(axis=0) / cell) * cell - margin * cell
    index = np.floor((points[:, :2] - origin) / cell).astype(int)
    shape = tuple(index.max(axis=0) + 1 + margin)
    heights = np.zeros(shape)
    np.maximum.at(heights, (index[:, 0], index[:, 1]), points[:, 2])
    mask = np.zeros(shape, dtype=np.uint8)
    mask[index[:, 0], index[:, 1]] = 1
    kernel = np.ones((3, 3), dtype=np.uint8)
    closed = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, kernel)
    filled = (closed == 1) & (mask == 0)
    heights[filled] = cv2.dilate(heights, kernel)[filled]
    return Silhouette(
        closed.astype(bool), np.array([cell, cell]), origin, heights, outward_bias=0.5
    )
