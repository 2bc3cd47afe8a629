"""Cloth sequences for training: states on grids and the manipulations between them (paper, IV-A).

Two kinds of files are read, told apart by their arrays:

- shards `shard_*.npz`: `grids` uint8 (N, L+1, 2048), the bits of boolean (32, 32, 16) grids in
  C order packed by `numpy.packbits`; `picks` (N, L, 2, 2) normalised, NaN for an unused hand;
  `moves` (N, L, 2) normalised;
- files of the paper's authors' generator: `states` (N, L+1, V, 3) normalised vertices, with
  `picks` and `moves` as above.
"""

from __future__ import annotations

import hashlib
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView
from emd_core.voxel_grid import voxelise


@dataclass(frozen=True)
class Windows:
    """Runs of successive states and the manipulations between them.

    Attributes:
        grids: Boolean, shape (B, n+1, X, Y, Z).
        manipulations: x0 y0 x1 y1 dx dy, shape (B, n, 6), float32, normalised; a NaN point: hand
            not used; both points and the displacement NaN: nothing was done and nothing changed.
    """

    grids: torch.Tensor
    manipulations: torch.Tensor


@dataclass(frozen=True)
class SequenceSet:
    """Sequences of any lengths, their grids kept packed in memory.

    Attributes:
        packed_grids: Shape (S, voxels / 8), uint8, all states of all sequences in order.
        manipulations: Shape (S, 6), float32: the one that follows each state; NaN after the last.
        first_states: Index of each sequence's first state, shape (N,).
        lengths: Manipulations in each sequence, shape (N,).
        grid_size: Voxels along x, y and z.
    """

    packed_grids: NDArray[np.uint8]
    manipulations: NDArray[np.float32]
    first_states: NDArray[np.int64]
    lengths: NDArray[np.int64]
    grid_size: tuple[int, int, int]

    def __len__(self) -> int:
        """Count the sequences."""
        return len(self.lengths)

    @property
    def manipulation_count(self) -> int:
        """Count the manipulation examples."""
        return int(self.lengths.sum())

    @property
    def content_hash(self) -> str:
        """SHA-256 over all grids and manipulations, to say what a net was trained on."""
        digest = hashlib.sha256(np.ascontiguousarray(self.packed_grids).data)
        digest.update(np.ascontiguousarray(self.manipulations).data)
        return digest.hexdigest()

    def subset(self, sequences: NDArray[np.int64]) -> SequenceSet:
        """Keep some sequences, in the order given."""
        rows = [
            np.arange(self.first_states[i], self.first_states[i] + self.lengths[i] + 1)
            for i in sequences
        ]
        lengths = self.lengths[sequences]
        chosen = np.concatenate(rows) if rows else np.zeros(0, dtype=np.int64)
        return SequenceSet(
            self.packed_grids[chosen],
            self.manipulations[chosen],
            _first_states(lengths),
            lengths,
            self.grid_size,
        )

    def split(self, held_out_share: float, seed: int = 0) -> tuple[SequenceSet, SequenceSet]:
        """Split into training and held-out sequences, always alike for the same data and seed.

        Raises:
            InvalidInputError: If either part would be empty.
        """
        order = np.random.default_rng(seed).permutation(len(self))
        held_out = max(1, round(held_out_share * len(self))) if held_out_share > 0 else 0
        if held_out in (0, len(self)):
            raise InvalidInputError(
                f"both parts of a split need sequences: {len(self)} with {held_out} held out; "
                "give more data, or a share between 0 and 1"
            )
        return self.subset(np.sort(order[held_out:])), self.subset(np.sort(order[:held_out]))

    def window_starts(self, steps: int) -> NDArray[np.int64]:
        """States from which `steps` recorded manipulations follow, shape (W,)."""
        return np.concatenate(
            [
                first + np.arange(max(0, length - steps + 1))
                for first, length in zip(self.first_states, self.lengths, strict=True)
            ]
        ).astype(np.int64)

    def windows(self, starts: NDArray[np.int64], steps: int) -> Windows:
        """Read windows; one that passes the end of its sequence stays at the last state.

        Args:
            starts: States at which the windows begin, shape (B,).
            steps: Manipulations in a window.
        """
        last = self.first_states + self.lengths
        end = last[np.searchsorted(last, starts)]
        states = np.minimum(starts[:, None] + np.arange(steps + 1), end[:, None])
        packed = self.packed_grids[states]
        bits = np.unpackbits(packed, axis=-1, count=int(np.prod(self.grid_size)))
        grids = bits.view(bool).reshape(*states.shape, *self.grid_size)
        manipulations = self.manipulations[states[:, :-1]]
        return Windows(torch.from_numpy(grids), torch.from_numpy(manipulations))


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
        _first_states(lengths),
        lengths,
        fov.size,
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
            if "grids" in stored:
                packed = np.asarray(stored["grids"])
            else:
                packed = _rasterise(path, np.asarray(stored["states"]), field_of_view)
    except (OSError, KeyError, ValueError, EOFError, zipfile.BadZipFile) as err:
        raise InvalidInputError(
            f"{path} should be an .npz with picks, moves and grids or states: {err}; "
            "make the data again"
        ) from err
    _check(path, packed, picks, moves, field_of_view)
    count, length = moves.shape[:2]
    # Cloth that leaves the field of view re-enters at the opposite edge, and so do the hands.
    points = (picks.reshape(count, length, 4) + 1.0) % 2.0 - 1.0
    manipulations = np.full((count, length + 1, 6), np.nan, dtype=np.float32)
    manipulations[:, :-1] = np.concatenate([points, moves], axis=2)
    lengths = np.full(count, length, dtype=np.int64)
    return SequenceSet(
        packed.reshape(-1, packed.shape[2]),
        manipulations.reshape(-1, 6),
        _first_states(lengths),
        lengths,
        field_of_view.size,
    )


def _rasterise(
    path: Path, states: NDArray[np.floating], field_of_view: FieldOfView
) -> NDArray[np.uint8]:
    if states.ndim != 4 or states.shape[3] != 3:
        raise InvalidInputError(f"{path}: states must be (N, L+1, V, 3), got {states.shape}")
    in_table = field_of_view.table_from_normalised(states)
    grids = [[voxelise(state, field_of_view).occupancy for state in row] for row in in_table]
    flat = np.array(grids).reshape(*states.shape[:2], -1)
    return np.packbits(flat, axis=-1)


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


def _first_states(lengths: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.concatenate([[0], np.cumsum(lengths + 1)[:-1]]).astype(np.int64)
