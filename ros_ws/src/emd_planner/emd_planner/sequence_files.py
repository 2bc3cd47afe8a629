"""Reading of cloth sequences from files (paper, IV-A).

Two kinds of files are read, told apart by their arrays:

- shards `shard_*.npz`: `grids` uint8 (N, L+1, 2048), the bits of boolean (32, 32, 16) grids in
  C order packed by `numpy.packbits`; `picks` (N, L, 2, 2) normalised, NaN for an unused hand;
  `moves` (N, L, 2) normalised; perhaps `states` (N, L+1, V, 3), the normalised vertices of the
  cloth's mid-surface, and `meta`, a JSON string that then tells the cloth's thickness;
- files of the paper's authors' generator: `states` (N, L+1, V, 3) normalised vertices, with
  `picks` and `moves` as above.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView
from emd_planner.dataset import SequenceSet, first_states
from emd_planner.rasterise import rasterise


def load_sequences(
    directories: Sequence[Path], field_of_view: FieldOfView | None = None
) -> SequenceSet:
    """Read all files of one or more directories, in the order of their names.

    Args:
        directories: Each with `shard_*.npz` or with the authors' `*.npz` files.
        field_of_view: The box and voxels of the grids; the default one if None.

    Raises:
        InvalidInputError: If a directory holds no such file or a file does not have the form.
    """
    fov = field_of_view or FieldOfView()
    parts = []
    for directory in directories:
        paths = sorted(directory.glob("shard_*.npz")) or sorted(directory.glob("*.npz"))
        if not paths:
            raise InvalidInputError(
                f"{directory} should hold shard_*.npz or the authors' *.npz files, found none"
            )
        parts += [read_sequence_file(path, fov) for path in paths]
    if not parts:
        raise InvalidInputError("at least one directory with sequences is needed, got none")
    lengths = np.concatenate([part.lengths for part in parts])
    return SequenceSet(
        np.concatenate([part.packed_grids for part in parts]),
        np.concatenate([part.manipulations for part in parts]),
        first_states(lengths),
        lengths,
        fov.size,
        _join_points([part.points for part in parts]),
    )


def read_sequence_file(path: Path, field_of_view: FieldOfView) -> SequenceSet:
    """Read one file of either kind.

    Raises:
        InvalidInputError: If the file cannot be read or does not have the form.
    """
    try:
        with np.load(path, allow_pickle=False) as stored:
            picks = np.asarray(stored["picks"], dtype=np.float32)
            moves = np.asarray(stored["moves"], dtype=np.float32)
            points = _upper_surface(path, stored, field_of_view)
            if "grids" in stored:
                packed = np.asarray(stored["grids"])
            elif points is not None:
                packed = _rasterise(points, field_of_view)
            else:
                raise KeyError("neither grids nor states")
    except (OSError, KeyError, ValueError, EOFError, zipfile.BadZipFile) as err:
        raise InvalidInputError(
            f"{path} should be an .npz with picks, moves and grids or states: {err}; "
            "make the data again"
        ) from err
    _check(path, packed, picks, moves, field_of_view)
    count, length = moves.shape[:2]
    # Cloth that leaves the field of view re-enters at the opposite edge, and so do the hands.
    grasps = (picks.reshape(count, length, 4) + 1.0) % 2.0 - 1.0
    manipulations = np.full((count, length + 1, 6), np.nan, dtype=np.float32)
    manipulations[:, :-1] = np.concatenate([grasps, moves], axis=2)
    lengths = np.full(count, length, dtype=np.int64)
    return SequenceSet(
        packed.reshape(-1, packed.shape[2]),
        manipulations.reshape(-1, 6),
        first_states(lengths),
        lengths,
        field_of_view.size,
        None if points is None else points.reshape(-1, *points.shape[2:]).astype(np.float16),
    )


def _upper_surface(
    path: Path, stored: Mapping[str, Any], field_of_view: FieldOfView
) -> NDArray[np.float32] | None:
    """Give the points that the grids show, shape (N, L+1, V, 3), if the file holds them."""
    if "states" not in stored:
        return None
    states = np.array(stored["states"], dtype=np.float32)
    if states.ndim != 4 or states.shape[3] != 3 or states.shape[2] < 1:
        raise InvalidInputError(f"{path}: states must be (N, L+1, V, 3), got {states.shape}")
    if not np.isfinite(states).all():
        raise InvalidInputError(f"{path}: states must be finite; make the data again")
    if "meta" in stored:
        thickness = json.loads(str(stored["meta"]))["cloth"]["thickness"]
        states[..., 2] += 0.5 * float(thickness) / field_of_view.half_extent
    return states


def _rasterise(points: NDArray[np.float32], field_of_view: FieldOfView) -> NDArray[np.uint8]:
    flat = torch.from_numpy(points).flatten(0, 1)
    chunks = [
        rasterise(chunk, field_of_view.size, field_of_view.height) for chunk in flat.split(256)
    ]
    grids = torch.cat(chunks).view(*points.shape[:2], -1)
    return np.packbits(grids.numpy(), axis=-1)


def _join_points(parts: list[NDArray[np.float16] | None]) -> NDArray[np.float16] | None:
    """Concatenate; clouds of fewer points repeat their first one, which changes no grid."""
    known = [part for part in parts if part is not None]
    if len(known) < len(parts):
        return None
    most = max(part.shape[1] for part in known)
    filled = [
        np.concatenate([part, np.repeat(part[:, :1], most - part.shape[1], axis=1)], axis=1)
        for part in known
    ]
    return np.concatenate(filled)


def _check(
    path: Path,
    packed: NDArray[np.uint8],
    picks: NDArray[np.float32],
    moves: NDArray[np.float32],
    field_of_view: FieldOfView,
) -> None:
    if moves.ndim != 3 or moves.shape[2] != 2 or moves.shape[1] < 1:
        raise InvalidInputError(f"{path}: moves must be (N, L, 2), got {moves.shape}")
    count, length = moves.shape[:2]
    width = -(-int(np.prod(field_of_view.size)) // 8)
    if packed.shape != (count, length + 1, width) or packed.dtype != np.uint8:
        raise InvalidInputError(
            f"{path}: grids must be uint8 {(count, length + 1, width)}, got {packed.dtype} "
            f"{packed.shape}; generate them with the field of view {field_of_view.size}"
        )
    if picks.shape != (count, length, 2, 2):
        raise InvalidInputError(f"{path}: picks must be (N, L, 2, 2), got {picks.shape}")
    unused = np.asarray(np.isnan(picks).any(axis=3))
    if np.isinf(picks).any() or (unused & ~np.isnan(picks).all(axis=3)).any():
        raise InvalidInputError(f"{path}: a pick must be finite, or NaN in both values")
    if unused.all(axis=2).any() or not np.isfinite(moves).all():
        raise InvalidInputError(f"{path}: each step needs a pick and a finite move")
