"""The silhouette of what perception saw, rasterised finer than the network's voxels."""

from __future__ import annotations

import cv2
import numpy as np

from emd_arm_executor.silhouette import Silhouette
from emd_core.errors import NoClothError
from emd_core.frames import FloatArray
from emd_core.voxel_grid import BoolArray, VoxelGrid

_MARGIN = (
    6  # cells around the cloth, of which the closing needs one and the hems' surroundings five
)


def silhouette_from_points(
    points_in_table: FloatArray, cell: float = 0.005, grid: VoxelGrid | None = None
) -> Silhouette:
    """Rasterise points of the cloth's upper surface.

    Cells between the points are closed, so that a cloud thinned to about the cells' size gives one
    piece; a gap wider than two cells stays a gap.

    Args:
        points_in_table: Shape (N, 3), metres, table frame.
        cell: Edge length of a cell, metres.
        grid: Of the same observation; tells which columns something hides. None: none.

    Raises:
        NoClothError: If there are no points.
    """
    points = np.asarray(points_in_table, dtype=np.float64)
    if points.size == 0:
        raise NoClothError("the last observation holds no points of a cloth; look again")
    origin = np.floor(points[:, :2].min(axis=0) / cell) * cell - _MARGIN * cell
    index = np.floor((points[:, :2] - origin) / cell).astype(int)
    shape = tuple(index.max(axis=0) + 1 + _MARGIN)
    heights = np.zeros(shape)
    np.maximum.at(heights, (index[:, 0], index[:, 1]), points[:, 2])
    mask = np.zeros(shape, dtype=np.uint8)
    mask[index[:, 0], index[:, 1]] = 1
    kernel = np.ones((3, 3), dtype=np.uint8)
    closed = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, kernel)
    filled = (closed == 1) & (mask == 0)
    heights[filled] = cv2.dilate(heights, kernel)[filled]
    unknown = None
    if grid is not None and grid.unknown is not None:
        unknown = _unknown_cells(grid, grid.unknown, origin, cell, closed.shape)
    return Silhouette(closed.astype(bool), np.array([cell, cell]), origin, heights, 0.5, unknown)


def _unknown_cells(
    grid: VoxelGrid, unknown: BoolArray, origin: FloatArray, cell: float, shape: tuple[int, ...]
) -> BoolArray:
    """Which cells have their middle in an unknown column, shape (X, Y); none beyond the grid."""
    fov = grid.field_of_view
    columns = [
        np.floor(
            (origin[axis] + (np.arange(shape[axis]) + 0.5) * cell - fov.origin[axis])
            / fov.resolution[axis]
        ).astype(int)
        for axis in (0, 1)
    ]
    inside = [(one >= 0) & (one < many) for one, many in zip(columns, unknown.shape, strict=True)]
    clipped = [one.clip(0, many - 1) for one, many in zip(columns, unknown.shape, strict=True)]
    return np.asarray(unknown[np.ix_(*clipped)] & inside[0][:, None] & inside[1])
