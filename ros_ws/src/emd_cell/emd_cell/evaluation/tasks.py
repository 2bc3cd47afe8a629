"""What planners are to do: parts of recorded sequences, and neat folds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.mesh import build_mesh, flat_positions
from emd_cloth_sim.neat_folds import NEAT_FOLDS, neat_fold
from emd_cloth_sim.replay import resample_sheet, vertex_order
from emd_cloth_sim.slight_crossings import part_slight_crossings
from emd_core.cloth_sequence import ClothSequence
from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView, FloatArray
from emd_core.manipulation import Manipulation
from emd_core.sequence_reader import SequenceFile, SequenceReader, read_sequences
from emd_core.sequence_split import in_split
from emd_core.voxel_grid import VoxelGrid, voxelise


@dataclass(frozen=True)
class Task:
    """From one state of a square cloth to another, by so many manipulations.

    Attributes:
        name: Unique among the tasks of an evaluation.
        group: Tasks of one group are averaged: the number of steps, or a fold's name.
        start: Mid-surface before, shape (V, 3), metres, table frame, row-major.
        goal: Mid-surface wanted, likewise.
        recorded: Manipulations that made the goal.
        surface_height: How far what a camera sees lies above the mid-surface, metres.
        field_of_view: The box that grids cover.
        sequence: Index of its sequence in the data set, by which splits go; 0: of none.
    """

    name: str
    group: str
    start: FloatArray
    goal: FloatArray
    recorded: tuple[Manipulation, ...]
    surface_height: float
    field_of_view: FieldOfView
    sequence: int = 0

    @property
    def steps(self) -> int:
        """Manipulations that a plan may have."""
        return len(self.recorded)

    def grid(self, positions: FloatArray) -> VoxelGrid:
        """Voxelise what a camera sees of a mid-surface (V, 3), metres."""
        return voxelise(positions + [0.0, 0.0, self.surface_height], self.field_of_view)


def sequence_tasks(
    paths: Sequence[Path],
    steps: Sequence[int],
    vertices: int,
    split: str = "all",
    limit: int | None = None,
) -> list[Task]:
    """Make a task of every part of `steps` manipulations of the first `limit` sequences.

    Args:
        paths: Directories or files, of ours or of the authors' generator.
        steps: Lengths of the parts.
        vertices: Of the cloth that will execute the plans, along one side.
        split: See `emd_core.sequence_split`.
        limit: Sequences to take; None: all.

    Raises:
        InvalidInputError: If the sequences lack vertices or cannot be read, or none of the split
            is long enough.
    """
    tasks: list[Task] = []
    chosen = (found for found in _sequences(paths) if in_split(found.index, split))
    for number, sequence in enumerate(chosen):
        if limit is not None and number >= limit:
            break
        tasks += _parts(sequence, f"{number:04d}", steps, vertices)
    if not tasks:
        raise InvalidInputError(
            f"no sequence of the split '{split}' has {min(steps, default=0)} manipulations or more"
        )
    return tasks


def neat_tasks(config: ClothConfig) -> list[Task]:
    """Make a task of every neat fold of a flat cloth."""
    flat = flat_positions(config.vertices, config.side_lengths)
    flat[:, 2] = config.rest_height
    return [
        Task(
            name,
            name,
            flat,
            fold.goal_positions,
            fold.manipulations,
            0.5 * config.thickness,
            FieldOfView(),
        )
        for name in NEAT_FOLDS
        for fold in [neat_fold(name, config)]
    ]


def _sequences(paths: Sequence[Path]) -> Iterator[ClothSequence]:
    """Read sequences with their vertices in row-major order."""
    reader = SequenceReader(paths)
    number = 0
    for file in reader.files:
        if file.vertices == 0:
            raise InvalidInputError(f"{file.path} has no vertices to start from; generate anew")
        if file.independent:
            raise InvalidInputError(
                f"{file.path} has a displacement for each hand, plans have one for both"
            )
        order = _order(file)
        for sequence in read_sequences(file, reader.field_of_view, number):
            number += 1
            assert sequence.states is not None
            states = np.asarray(sequence.states)[:, order]
            yield ClothSequence(
                sequence.index,
                sequence.packed_grids,
                sequence.picks,
                sequence.moves,
                states,
                sequence.surface_height,
                sequence.field_of_view,
            )


def _order(file: SequenceFile) -> slice | np.ndarray:
    """How to read a file's vertices row by row; the authors' generator has an order of its own."""
    if file.meta:
        return slice(None)
    with np.load(file.path, allow_pickle=False) as stored:
        first = np.asarray(stored["states"][:, 0], dtype=np.float64)
    return vertex_order(first, round(file.vertices**0.5))


def _parts(
    sequence: ClothSequence, name: str, steps: Sequence[int], vertices: int
) -> Iterator[Task]:
    fov = sequence.field_of_view
    assert sequence.states is not None
    states = [
        resample_sheet(fov.table_from_normalised(state), vertices) for state in sequence.states
    ]
    manipulations = [
        Manipulation(fov.table_from_normalised(picks), fov.table_from_normalised(move))
        for picks, move in zip(sequence.picks, sequence.moves, strict=True)
    ]
    height = float(fov.table_from_normalised(sequence.surface_height))
    mesh, size = build_mesh((vertices, vertices), (1.0, 1.0)), (vertices, vertices)
    # Stored vertices are rounded, by which layers that touch may cross.
    starts = [part_slight_crossings(state, mesh, size) for state in states[:-1]]
    for count in steps:
        for first in range(len(sequence) - count + 1):
            yield Task(
                f"{name}.{first}.{count}",
                str(count),
                starts[first],
                states[first + count],
                tuple(manipulations[first : first + count]),
                height,
                fov,
                sequence.index,
            )
