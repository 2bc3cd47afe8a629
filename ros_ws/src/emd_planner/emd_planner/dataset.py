"""Cloth sequences for training: states and the manipulations between them (paper, IV-A)."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from emd_core.errors import InvalidInputError
from emd_planner.sequence_tensors import SequenceTensors, Windows


@dataclass(frozen=True)
class SequenceSet:
    """Sequences of any lengths, their grids kept packed in memory.

    Attributes:
        packed_grids: Shape (S, voxels / 8), uint8, all states of all sequences in order.
        manipulations: Shape (S, 6), float32: the one that follows each state; NaN after the last.
        first_states: Index of each sequence's first state, shape (N,).
        lengths: Manipulations in each sequence, shape (N,).
        grid_size: Voxels along x, y and z.
        points: Shape (S, V, 3), float16, normalised, of the cloth's upper surface; NaN in
            sequences whose files lack them; None if all do.
        mixed: Whether each sequence was mixed in beside the others, shape (N,); None: none was.
    """

    packed_grids: NDArray[np.uint8]
    manipulations: NDArray[np.float32]
    first_states: NDArray[np.int64]
    lengths: NDArray[np.int64]
    grid_size: tuple[int, int, int]
    points: NDArray[np.float16] | None = None
    mixed: NDArray[np.bool_] | None = None

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
            first_states(lengths),
            lengths,
            self.grid_size,
            None if self.points is None else self.points[chosen],
            None if self.mixed is None else self.mixed[sequences],
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

    @property
    def pointless_count(self) -> int:
        """Count the manipulation examples whose cloth's points are unknown."""
        if self.points is None:
            return self.manipulation_count
        unknown = np.isnan(self.points[self.first_states, 0, 0])
        return int(self.lengths[unknown].sum())

    def window_starts(self, steps: int, mixed: bool | None = None) -> NDArray[np.int64]:
        """States from which `steps` recorded manipulations follow, shape (W,).

        Args:
            steps: Manipulations in a window.
            mixed: Only of sequences that were mixed in, or only of the others; None: of all.
        """
        wanted = np.ones(len(self), dtype=bool)
        if mixed is not None:
            wanted = np.full(len(self), not mixed) if self.mixed is None else self.mixed == mixed
        starts = [
            first + np.arange(max(0, length - steps + 1))
            for first, length in zip(self.first_states[wanted], self.lengths[wanted], strict=True)
        ]
        return np.concatenate([np.zeros(0), *starts]).astype(np.int64)

    @property
    def tensors(self) -> SequenceTensors:
        """The same as tensors, which share the memory."""
        last_states = np.repeat(self.first_states + self.lengths, self.lengths + 1)
        return SequenceTensors(
            torch.from_numpy(self.packed_grids),
            torch.from_numpy(self.manipulations),
            torch.from_numpy(last_states),
            self.grid_size,
            None if self.points is None else torch.from_numpy(self.points),
        )

    def windows(self, starts: NDArray[np.int64], steps: int) -> Windows:
        """Read windows that begin at these states (B,); see `SequenceTensors.windows`."""
        return self.tensors.windows(torch.from_numpy(starts), steps)


def first_states(lengths: NDArray[np.int64]) -> NDArray[np.int64]:
    """Index of each sequence's first state when states lie one after the other, shape (N,)."""
    return (np.cumsum(lengths + 1) - (lengths + 1)).astype(np.int64)
