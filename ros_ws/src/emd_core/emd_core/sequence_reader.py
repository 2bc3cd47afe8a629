"""Reading of cloth sequences one after the other, however many there are.

Two kinds of files are read, told apart by their arrays: shards (`emd_core.sequence_shard`), and
files of the paper's authors' generator: `states` (N, L + 1, V, 3), `picks` (N, L, 2, 2) and
`moves` (N, L, 2), all normalised, of which the grids are then made.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emd_core.cloth_sequence import ClothSequence
from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView
from emd_core.npz_stream import READ_ERRORS, NpzReader
from emd_core.sequence_shard import PATTERN, SequenceFailure, failures_of, read_meta
from emd_core.voxel_grid import voxelise


@dataclass(frozen=True)
class SequenceFile:
    """What the header of a file tells.

    Attributes:
        path: The file.
        count: Sequences in it.
        steps: Manipulations in each.
        vertices: Of a state; 0 if the file has no states.
        independent: Whether each hand has a displacement of its own.
        meta: Provenance; empty in files of the authors' generator.
    """

    path: Path
    count: int
    steps: int
    vertices: int
    independent: bool
    meta: dict[str, Any]

    @property
    def failures(self) -> tuple[SequenceFailure, ...]:
        """Sequences that are missing, with their reasons."""
        return failures_of(self.meta)


class SequenceReader:
    """The sequences of one or more directories, in the order of the files' names.

    Iterating reads one sequence at a time. `files` and `len` come from the headers.
    """

    def __init__(
        self, directories: Sequence[Path], field_of_view: FieldOfView | None = None
    ) -> None:
        """Find the files and read their headers.

        Args:
            directories: Each with `shard_*.npz` or with the authors' `*.npz` files; or such files.
            field_of_view: The box and voxels of the grids; the default one if None.

        Raises:
            InvalidInputError: If a directory holds no such file or a header has another form.
        """
        self.field_of_view = field_of_view or FieldOfView()
        if not directories:
            raise InvalidInputError("at least one directory with sequences is needed, got none")
        self.files = [
            read_header(path, self.field_of_view)
            for directory in directories
            for path in sequence_paths(directory)
        ]

    def __len__(self) -> int:
        """Count the sequences."""
        return sum(file.count for file in self.files)

    @property
    def lengths(self) -> NDArray[np.int64]:
        """Manipulations in each sequence, shape (N,)."""
        steps = [file.steps for file in self.files]
        return np.repeat(steps, [file.count for file in self.files]).astype(np.int64)

    @property
    def failures(self) -> list[SequenceFailure]:
        """Sequences that are missing, with their reasons."""
        return [failure for file in self.files for failure in file.failures]

    def __iter__(self) -> Iterator[ClothSequence]:
        """Read one sequence after the other.

        Raises:
            InvalidInputError: If a file cannot be read or a value is not what it should be.
        """
        number = 0
        for file in self.files:
            for sequence in read_sequences(file, self.field_of_view, number):
                number += 1
                yield sequence


def sequence_paths(directory: Path) -> list[Path]:
    """Find a directory's files: shards if there are any, otherwise the authors' files.

    A file stands for itself.

    Raises:
        InvalidInputError: If there is neither.
    """
    if directory.is_file():
        return [directory]
    paths = sorted(directory.glob(PATTERN)) or sorted(directory.glob("[!.]*.npz"))
    if not paths:
        raise InvalidInputError(
            f"{directory} should hold {PATTERN} or the authors' *.npz files, found none"
        )
    return paths


def read_header(path: Path, field_of_view: FieldOfView) -> SequenceFile:
    """Read shapes and provenance of a file, not its arrays.

    Raises:
        InvalidInputError: If the file cannot be read or a shape is wrong.
    """
    try:
        with NpzReader(path) as stored:
            shapes = {name: stored.shape(name) for name in ("picks", "moves")}
            for name in ("grids", "states"):
                if name in stored:
                    shapes[name] = stored.shape(name)
            if "grids" not in shapes and "states" not in shapes:
                raise KeyError("neither grids nor states")
            if "grids" in stored and stored.dtype("grids") != np.uint8:
                raise ValueError(f"grids must be uint8, got {stored.dtype('grids')}")
            meta = read_meta(stored)
    except READ_ERRORS as err:
        raise _unreadable(path, err) from err
    _check_shapes(path, shapes, field_of_view)
    count, steps = shapes["moves"][:2]
    vertices = shapes["states"][2] if "states" in shapes else 0
    return SequenceFile(path, count, steps, vertices, len(shapes["moves"]) == 4, meta)


def read_sequences(
    file: SequenceFile, field_of_view: FieldOfView, first: int = 0
) -> Iterator[ClothSequence]:
    """Read a file sequence by sequence.

    Args:
        file: Its header.
        field_of_view: The box and voxels of the grids.
        first: Index of the first sequence if the file does not tell the indices.

    Raises:
        InvalidInputError: If the file cannot be read or a value is not what it should be.
    """
    surface = _surface_height(file, field_of_view)
    try:
        with NpzReader(file.path) as stored:
            indices = (
                stored.array("indices") if "indices" in stored else first + np.arange(file.count)
            )
            picks, moves = stored.rows("picks"), stored.rows("moves")
            grids = stored.rows("grids") if "grids" in stored else None
            states = stored.rows("states") if "states" in stored else None
            for index in indices:
                vertices = None if states is None else next(states)
                packed = next(grids) if grids else _packed(vertices, surface, field_of_view)
                yield ClothSequence(
                    int(index),
                    packed,
                    next(picks).astype(np.float32),
                    next(moves).astype(np.float32),
                    vertices,
                    surface,
                    field_of_view,
                )
    except READ_ERRORS as err:
        raise _unreadable(file.path, err) from err
    except InvalidInputError as err:
        raise InvalidInputError(f"{file.path}: {err}") from err


def _surface_height(file: SequenceFile, field_of_view: FieldOfView) -> float:
    """Half the thickness, normalised; the authors' vertices are themselves what the grids show."""
    if not file.vertices or not file.meta:
        return 0.0
    try:
        thickness = float(file.meta["cloth"]["thickness"])
    except (KeyError, TypeError, ValueError) as err:
        raise _unreadable(file.path, KeyError("meta without the cloth's thickness")) from err
    return 0.5 * thickness / field_of_view.half_extent


def _packed(
    vertices: NDArray[np.floating] | None, surface: float, field_of_view: FieldOfView
) -> NDArray[np.uint8]:
    """Make the packed grids of a sequence's states, shape (L + 1, V, 3)."""
    if vertices is None or not np.isfinite(vertices).all():
        raise InvalidInputError("states must be finite; make the data again")
    points = field_of_view.table_from_normalised(vertices + np.array([0.0, 0.0, surface]))
    grids = [np.packbits(voxelise(state, field_of_view).occupancy) for state in points]
    return np.stack(grids)


def _unreadable(path: Path, err: Exception) -> InvalidInputError:
    return InvalidInputError(
        f"{path} should be an .npz with picks, moves and grids or states: {err}; "
        "make the data again"
    )


def _check_shapes(
    path: Path, shapes: dict[str, tuple[int, ...]], field_of_view: FieldOfView
) -> None:
    moves = shapes["moves"]
    if len(moves) not in (3, 4) or moves[2:] not in ((2,), (2, 2)) or moves[1] < 1:
        raise InvalidInputError(
            f"{path}: moves must be (N, L, 2), or (N, L, 2, 2) for independent hands, got {moves}"
        )
    count, length = moves[:2]
    wanted = {
        "picks": (count, length, 2, 2),
        "grids": (count, length + 1, -(-int(np.prod(field_of_view.size)) // 8)),
    }
    for name, shape in wanted.items():
        if shapes.get(name, shape) != shape:
            raise InvalidInputError(
                f"{path}: {name} must be {shape}, got {shapes[name]}; generate them with the "
                f"field of view {field_of_view.size}"
            )
    states = shapes.get("states", (count, length + 1, 1, 3))
    if len(states) != 4 or states[:2] != (count, length + 1) or states[2] < 1 or states[3] != 3:
        raise InvalidInputError(f"{path}: states must be (N, L+1, V, 3), got {states}")
