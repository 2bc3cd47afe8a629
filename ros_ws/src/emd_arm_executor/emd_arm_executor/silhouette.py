"""The cloth's outline as a metric mask in the table frame, wherever it comes from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray
from emd_core.voxel_grid import BoolArray, VoxelGrid


@dataclass(frozen=True)
class Silhouette:
    """Which cells of a metric raster hold cloth, and how high it lies there.

    Attributes:
        mask: True where there is cloth, axes (X, Y) of the table frame.
        resolution: Edge lengths of a cell along x and y, shape (2,), metres.
        origin_in_table: Outer corner of cell (0, 0), shape (2,), metres.
        heights: Height of the cloth's top above the table, axes (X, Y), metres; 0 where there is
            none. None means that the cloth lies flat.
        outward_bias: How far the mask reaches beyond the cloth on average, in cells: 0 for a
            mask that takes a cell when its centre is cloth (a camera's), 0.5 for one that takes
            every cell that the cloth touches (a voxel grid's).
        unknown: Cells that something hides, axes (X, Y); None if all are known. Where the mask
            ends at such cells, the cloth need not.
    """

    mask: BoolArray
    resolution: FloatArray
    origin_in_table: FloatArray
    heights: FloatArray | None = None
    outward_bias: float = 0.0
    unknown: BoolArray | None = None

    def __post_init__(self) -> None:
        """Check shapes and values.

        Raises:
            InvalidInputError: If an array has the wrong shape or type, or a cell has no size.
        """
        mask = np.asarray(self.mask)
        resolution = np.asarray(self.resolution, dtype=np.float64)
        origin = np.asarray(self.origin_in_table, dtype=np.float64)
        if mask.ndim != 2 or mask.dtype != np.bool_ or mask.size == 0:
            raise InvalidInputError(
                f"a silhouette needs a boolean mask (X, Y), got {mask.dtype} {mask.shape}"
            )
        if resolution.shape != (2,) or origin.shape != (2,) or not (resolution > 0).all():
            raise InvalidInputError(
                "a silhouette needs a positive cell size (2,) and an origin (2,) in metres, got "
                f"{resolution} and {origin}"
            )
        if self.heights is not None and np.shape(self.heights) != mask.shape:
            raise InvalidInputError(
                f"heights must have the mask's shape {mask.shape}, got {np.shape(self.heights)}"
            )
        if self.unknown is not None and np.shape(self.unknown) != mask.shape:
            raise InvalidInputError(
                f"unknown must have the mask's shape {mask.shape}, got {np.shape(self.unknown)}"
            )
        object.__setattr__(self, "resolution", resolution)
        object.__setattr__(self, "origin_in_table", origin)

    @classmethod
    def from_voxel_grid(cls, grid: VoxelGrid) -> Silhouette:
        """Take the occupied columns of a grid and lay a wrapped cloth out in one piece.

        The network's grid is periodic in x and y, the table is not: what left the field of view
        on one side stands on the other. Along each axis the ring of columns is cut in the middle
        of its widest empty stretch, and the piece is placed on the period that brings its middle
        nearest to the table frame's origin.
        """
        fov = grid.field_of_view
        mask, heights = grid.silhouette, grid.height_map
        unknown = np.zeros_like(mask) if grid.unknown is None else grid.unknown
        origin = fov.origin[:2].copy()
        for axis in (0, 1):
            start, offset = _cut(np.asarray(mask.any(axis=1 - axis)))
            mask = np.roll(mask, -start, axis=axis)
            heights = np.roll(heights, -start, axis=axis)
            unknown = np.roll(unknown, -start, axis=axis)
            origin[axis] += offset * fov.resolution[axis]
        return cls(mask, fov.resolution[:2], origin, heights, 0.5, unknown)

    @property
    def top(self) -> float:
        """Height of the highest point of the cloth above the table, metres."""
        if self.heights is None or not self.mask.any():
            return 0.0
        return float(np.max(self.heights[self.mask]))

    def covers(self, points_in_table: FloatArray) -> BoolArray:
        """Tell for points (N, 2), metres, whether there is cloth; False outside the raster."""
        return self._at(self.mask, points_in_table)

    def hides(self, points_in_table: FloatArray) -> BoolArray:
        """Tell for points (N, 2), metres, what something hides; False outside the raster."""
        if self.unknown is None:
            return np.zeros(len(points_in_table), dtype=bool)
        return self._at(self.unknown, points_in_table)

    def _at(self, raster: BoolArray, points_in_table: FloatArray) -> BoolArray:
        index = np.floor((points_in_table - self.origin_in_table) / self.resolution).astype(int)
        inside = ((index >= 0) & (index < raster.shape)).all(axis=1)
        found = np.zeros(len(index), dtype=bool)
        found[inside] = raster[tuple(index[inside].T)]
        return found

    def height_near(self, point_in_table: ArrayLike, radius: float) -> float:
        """Give the greatest height of the cloth within `radius` of a point (2,), metres."""
        if self.heights is None:
            return 0.0
        point = np.asarray(point_in_table, dtype=np.float64)
        reach = radius + float(self.resolution.max()) / 2.0
        centre = (point - self.origin_in_table) / self.resolution - 0.5
        # Only the cells around the point are looked at; there may be many others.
        first = np.ceil(centre - reach / self.resolution).astype(int).clip(0, self.mask.shape)
        last = np.floor(centre + reach / self.resolution).astype(int).clip(-1, self.mask.shape)
        window = tuple(slice(i, j + 1) for i, j in zip(first, last, strict=True))
        offsets = [
            (np.arange(count)[part] - centre[axis]) * self.resolution[axis]
            for axis, (count, part) in enumerate(zip(self.mask.shape, window, strict=True))
        ]
        near = np.hypot(offsets[0][:, None], offsets[1][None, :]) <= reach
        near &= self.mask[window]
        return float(self.heights[window][near].max()) if near.any() else 0.0

    def is_hidden(self, point_in_table: ArrayLike, direction: ArrayLike, reach: float) -> bool:
        """Tell whether something hides a place within `reach` of a point along a direction.

        Args:
            point_in_table: Shape (2,), metres.
            direction: Unit vector, shape (2,).
            reach: Metres.
        """
        if self.unknown is None:
            return False
        steps = np.linspace(0.0, reach, 2 + int(reach / self.resolution.min()))
        places = np.asarray(point_in_table) + steps[:, None] * np.asarray(direction)
        cells = np.floor((places - self.origin_in_table) / self.resolution).astype(int)
        cells = cells[((cells >= 0) & (cells < self.mask.shape)).all(axis=1)]
        return bool(self.unknown[cells[:, 0], cells[:, 1]].any())


def _cut(occupied: BoolArray) -> tuple[int, int]:
    """Find where to cut a ring of columns.

    Returns:
        The column that comes first after the cut, and how many columns the origin moves.
    """
    count = len(occupied)
    if occupied.all() or not occupied.any():
        return 0, 0
    (full,) = np.nonzero(occupied)
    gaps = np.diff(np.append(full, full[0] + count)) - 1
    widest = int(np.argmax(gaps))
    if gaps[widest] == 0:
        return 0, 0
    first = int(full[(widest + 1) % len(full)])
    length = count - int(gaps[widest])
    # The piece begins at column `first`; of its periods the one nearest to the middle is meant.
    middle = first + length / 2.0 - count / 2.0
    shift = first - count * round(middle / count)
    # Leave half of the empty stretch on either side of the piece.
    margin = int(gaps[widest]) // 2
    return (first - margin) % count, shift - margin
