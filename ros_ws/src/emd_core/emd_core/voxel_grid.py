"""The cloth's state: a binary 32 x 32 x 16 voxel grid seen from above (paper, III-A)."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView, FloatArray
from emd_core.whole_file import whole_file

BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class VoxelGrid:
    """Occupancy of the field of view by cloth, occluded voxels included.

    Attributes:
        occupancy: Boolean array with axes (X, Y, Z) of the table frame.
        field_of_view: The box that the grid covers.
        unknown: Columns of which it is not known whether they hold cloth, because something hides
            them, shape (X, Y); None if all are known. What `occupancy` says there is what was
            seen of them, if anything.
    """

    occupancy: BoolArray
    field_of_view: FieldOfView = field(default_factory=FieldOfView)
    unknown: BoolArray | None = None

    def __post_init__(self) -> None:
        """Check the shape.

        Raises:
            InvalidInputError: If `occupancy` or `unknown` is not boolean of the field of view's
                size.
        """
        if self.occupancy.shape != tuple(self.field_of_view.size):
            raise InvalidInputError(
                f"a voxel grid of size {tuple(self.field_of_view.size)} was wanted, got shape "
                f"{self.occupancy.shape}; voxelise again with this field of view"
            )
        if self.occupancy.dtype != np.bool_:
            raise InvalidInputError(
                f"occupancy must be boolean, got {self.occupancy.dtype}; threshold it first"
            )
        unknown = self.unknown
        if unknown is not None and (
            unknown.shape != self.occupancy.shape[:2] or unknown.dtype != np.bool_
        ):
            raise InvalidInputError(
                f"unknown columns must be boolean of shape {self.occupancy.shape[:2]}, got "
                f"{unknown.dtype} of shape {unknown.shape}; leave them out if all are known"
            )

    @property
    def unknown_count(self) -> int:
        """How many columns are not known."""
        return 0 if self.unknown is None else int(np.count_nonzero(self.unknown))

    @property
    def silhouette(self) -> BoolArray:
        """Columns that hold cloth, shape (X, Y)."""
        return np.asarray(self.occupancy.any(axis=2), dtype=np.bool_)

    @property
    def height_map(self) -> FloatArray:
        """Height of the top of each column's highest voxel, shape (X, Y), metres; 0 when empty."""
        layers = np.arange(1, self.occupancy.shape[2] + 1)
        top = (self.occupancy * layers).max(axis=2)
        return np.asarray(top * self.field_of_view.resolution[2], dtype=np.float64)

    def save(self, path: Path) -> None:
        """Write an .npz with `occupancy` (uint8), `half_extent` (m) and `height` (normalised).

        Where columns are not known, `unknown` (uint8) is there too. The file appears whole or not
        at all.
        """
        arrays: dict[str, ArrayLike] = {
            "occupancy": self.occupancy.astype(np.uint8),
            "half_extent": self.field_of_view.half_extent,
            "height": self.field_of_view.height,
        }
        if self.unknown is not None:
            arrays["unknown"] = self.unknown.astype(np.uint8)
        with whole_file(path) as temporary, open(temporary, "wb") as stream:
            np.savez_compressed(stream, allow_pickle=False, **arrays)

    @classmethod
    def load(cls, path: Path) -> VoxelGrid:
        """Read what `save` wrote.

        Raises:
            InvalidInputError: If the file is missing or is not such a grid.
        """
        try:
            with np.load(path, allow_pickle=False) as stored:
                occupancy = np.asarray(stored["occupancy"])
                half_extent = float(stored["half_extent"])
                height = float(stored["height"])
                unknown = stored["unknown"].astype(bool) if "unknown" in stored else None
        except (OSError, KeyError, ValueError, EOFError) as err:
            raise InvalidInputError(
                f"{path} should be a voxel grid (.npz with occupancy, half_extent, height): {err}"
            ) from err
        if occupancy.ndim != 3:
            raise InvalidInputError(
                f"{path}: occupancy must have axes (X, Y, Z), got shape {occupancy.shape}"
            )
        size = (occupancy.shape[0], occupancy.shape[1], occupancy.shape[2])
        return cls(occupancy.astype(bool), FieldOfView(half_extent, height, size), unknown)


def voxelise(points_in_table: ArrayLike, field_of_view: FieldOfView | None = None) -> VoxelGrid:
    """Rasterise points of the cloth: 1 where a point falls, and below every 1 (paper, III-A).

    x and y wrap periodically. z is stretched by 4 through the flat voxels. A point above the box
    counts for the top layer and one below the desk for the bottom layer, because a column that
    holds cloth must never read as empty; the paper does not say what it does there.

    Args:
        points_in_table: Shape (N, 3), metres, table frame; N may be 0.
        field_of_view: The box and its voxels; the default one if None.

    Raises:
        InvalidInputError: If the shape is wrong or a coordinate is not finite.
    """
    fov = field_of_view or FieldOfView()
    points = np.asarray(points_in_table, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InvalidInputError(f"points must have shape (N, 3), got {points.shape}")
    if not np.isfinite(points).all():
        raise InvalidInputError("points must be finite, got NaN or infinity; drop such points")
    size = np.array(fov.size)
    index = np.floor((points - fov.origin) / fov.resolution).astype(np.int64)
    index[:, :2] %= size[:2]
    index[:, 2] = np.clip(index[:, 2], 0, size[2] - 1)
    occupancy = np.zeros(fov.size, dtype=bool)
    occupancy[index[:, 0], index[:, 1], index[:, 2]] = True
    return VoxelGrid(fill_occluded(occupancy), fov)


def fill_occluded(occupancy: BoolArray) -> BoolArray:
    """Set every voxel below a 1-voxel, as a camera above cannot see there (paper, III-A)."""
    return np.logical_or.accumulate(occupancy[..., ::-1], axis=-1)[..., ::-1].copy()
