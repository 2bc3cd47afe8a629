"""Voxel grids that come from outside: bounded, and read without running anything in them."""

from __future__ import annotations

import io
import zipfile

import numpy as np

from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView
from emd_core.voxel_grid import VoxelGrid

LARGEST_UPLOAD = 256 * 1024
_LARGEST_UNPACKED = 8 * 1024 * 1024
_NAMES = ("occupancy", "half_extent", "height")


def grid_from_bytes(content: bytes, field_of_view: FieldOfView | None = None) -> VoxelGrid:
    """Read an uploaded .npz as `VoxelGrid.save` writes it.

    Args:
        content: The file.
        field_of_view: What it must have; the cell's own if None.

    Raises:
        InvalidInputError: If it is too large, holds pickled objects, is no such file, or has
            another field of view.
    """
    wanted = field_of_view or FieldOfView()
    if len(content) > LARGEST_UPLOAD:
        raise InvalidInputError(
            f"a voxel grid's file of at most {LARGEST_UPLOAD // 1024} KiB is wanted, got "
            f"{len(content) // 1024} KiB"
        )
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            arrays = {name: _array(archive, name) for name in _NAMES}
        occupancy = arrays["occupancy"]
        half_extent, height = (float(arrays[name].reshape(())) for name in _NAMES[1:])
    except (
        KeyError,
        ValueError,
        OSError,
        EOFError,
        zipfile.BadZipFile,
        RuntimeError,
        MemoryError,
    ) as err:
        raise InvalidInputError(
            f"a voxel grid's .npz with {', '.join(_NAMES)} is wanted, this is none: {err}"
        ) from err
    if occupancy.dtype not in (np.dtype(bool), np.dtype(np.uint8)) or occupancy.max(initial=0) > 1:
        raise InvalidInputError("occupancy must hold 0 and 1; threshold the grid first")
    if occupancy.shape != wanted.size or not np.allclose(
        (half_extent, height), (wanted.half_extent, wanted.height)
    ):
        raise InvalidInputError(
            f"a grid of {wanted.size} voxels with half_extent {wanted.half_extent:.4f} and height "
            f"{wanted.height} is wanted, got {occupancy.shape}, {half_extent:.4f} and {height}; "
            "voxelise the goal with the cell's field of view"
        )
    return VoxelGrid(occupancy.astype(bool), wanted)


def _array(archive: zipfile.ZipFile, name: str) -> np.ndarray:
    """Read one array, of a size that is checked before it is unpacked."""
    entry = archive.getinfo(f"{name}.npy")
    if entry.file_size > _LARGEST_UNPACKED:
        raise ValueError(f"{name} has {entry.file_size} bytes unpacked")
    with archive.open(entry) as stream:
        content = stream.read(_LARGEST_UNPACKED + 1)
    return np.asarray(np.lib.format.read_array(io.BytesIO(content), allow_pickle=False))
