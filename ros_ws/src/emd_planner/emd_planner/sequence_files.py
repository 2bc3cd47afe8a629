"""Reading of cloth sequences for training, through `emd_core.sequence_reader`.

The set is filled sequence by sequence, so that no more than it and one sequence are in memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from emd_core.cloth_sequence import ClothSequence
from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView
from emd_core.sequence_reader import SequenceReader
from emd_core.sequence_split import in_split
from emd_planner.dataset import SequenceSet, first_states


def load_sequences(
    directories: Sequence[Path],
    field_of_view: FieldOfView | None = None,
    split: str = "all",
    mix: Sequence[Path] = (),
) -> SequenceSet:
    """Read all files of one or more directories, in the order of their names.

    Args:
        directories: Each with `shard_*.npz` or with the authors' `*.npz` files.
        field_of_view: The box and voxels of the grids; the default one if None.
        split: Which sequences are kept; see `emd_core.sequence_split`.
        mix: Further directories, whose sequences are marked as mixed in.

    Raises:
        InvalidInputError: If a directory holds no such file, a file does not have the form, or
            its hands move independently, which the net's six inputs cannot say.
    """
    reader = SequenceReader([*directories, *mix], field_of_view)
    for file in reader.files:
        if file.independent:
            raise InvalidInputError(
                f"{file.path} has a displacement for each hand, but the net takes one for both; "
                "generate the data without --independent-hands"
            )
    mixed = len(SequenceReader(mix, field_of_view)) if mix else 0
    data, kept = _empty_set(reader, mixed), []
    for number, sequence in enumerate(reader):
        if in_split(sequence.index, split):
            kept.append(number)
        first = int(data.first_states[number])
        rows = slice(first, first + len(sequence) + 1)
        data.packed_grids[rows] = sequence.packed_grids
        data.manipulations[rows.start : rows.stop - 1] = _network_input(sequence)
        if data.points is not None:
            _fill_points(data.points[rows], sequence)
    return data if len(kept) == len(data) else data.subset(np.array(kept, dtype=np.int64))


def _empty_set(reader: SequenceReader, mixed: int) -> SequenceSet:
    """Make room for what the headers announce; the last `mixed` sequences are mixed in."""
    lengths = reader.lengths
    states = int((lengths + 1).sum())
    size = reader.field_of_view.size
    files = [file for file in reader.files if file.count]
    vertices = max((file.vertices for file in files), default=0)
    return SequenceSet(
        np.empty((states, -(-int(np.prod(size)) // 8)), dtype=np.uint8),
        np.full((states, 6), np.nan, dtype=np.float32),
        first_states(lengths),
        lengths,
        size,
        np.full((states, vertices, 3), np.nan, np.float16) if vertices else None,
        np.arange(len(lengths)) >= len(lengths) - mixed if mixed else None,
    )


def _network_input(sequence: ClothSequence) -> NDArray[np.float32]:
    # Cloth that leaves the field of view re-enters at the opposite edge, and so do the hands.
    grasps = (sequence.picks.reshape(len(sequence), 4) + 1.0) % 2.0 - 1.0
    return np.concatenate([grasps, sequence.moves], axis=1)


def _fill_points(target: NDArray[np.float16], sequence: ClothSequence) -> None:
    """Write the upper surface; smaller clouds repeat their first point, which changes no grid."""
    points = sequence.upper_surface
    if points is not None:
        target[:] = points[:, :1]
        target[:, : points.shape[1]] = points
