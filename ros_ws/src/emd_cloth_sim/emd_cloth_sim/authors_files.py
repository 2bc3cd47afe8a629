"""Import and export of the format of the paper's authors' public generator.

An .npz with `states` (N, L + 1, V, 3), `picks` (N, L, 2, 2) whose unused hands are NaN, and
`moves` (N, L, 2), all normalised, for a square mesh that spans 1.4 when flat. Its vertices are
what the voxel grids show, so an export holds our upper surface and an import has no thickness.
"""

from __future__ import annotations

import hashlib
import itertools
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emd_cloth_sim.replay import SPAN, vertex_order
from emd_core.cloth_sequence import ClothSequence
from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView
from emd_core.npz_stream import StreamedArray, save_npz
from emd_core.sequence_reader import (
    SequenceFile,
    SequenceReader,
    read_header,
    read_sequences,
    sequence_paths,
)
from emd_core.sequence_shard import SequenceShard

SHARD_SIZE = 16


def import_authors_files(
    source: Path, folder: Path, on_progress: Callable[[int, int], None] | None = None
) -> int:
    """Write a file, or a directory of files, of the authors' format as a data set of ours.

    Vertices are put into row-major order. Arrays of other names are left out.

    Args:
        source: The file or directory.
        folder: Where to; must be new or empty, and appears whole or not at all.
        on_progress: Called with the sequences done and their total.

    Returns:
        How many sequences there were.

    Raises:
        InvalidInputError: If the folder holds something, or a file does not have the form.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InvalidInputError(f"{folder} must be new or empty to import into")
    paths = [source] if source.is_file() else sequence_paths(source)
    files = [read_header(path, FieldOfView()) for path in paths]
    total = sum(file.count for file in files)
    folder.parent.mkdir(parents=True, exist_ok=True)
    unfinished = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", dir=folder.parent))
    try:
        done = 0
        for number, shard in enumerate(_shards(files)):
            shard.write(unfinished / f"shard_{number:05d}.npz")
            done += len(shard.arrays["indices"])
            if on_progress is not None:
                on_progress(done, total)
        os.chmod(unfinished, 0o755)
        os.replace(unfinished, folder)
    except BaseException:
        shutil.rmtree(unfinished)
        raise
    return total


def export_authors_file(directory: Path, path: Path) -> int:
    """Write a data set as one file of the authors' format, however large; whole or not at all.

    Returns:
        How many sequences it holds.

    Raises:
        InvalidInputError: If the sequences differ in length or mesh, lack vertices, or have
            independent hands, which the format cannot say.
    """
    reader = SequenceReader([directory])
    files = [file for file in reader.files if file.count]
    shapes = {(file.steps, file.vertices, file.independent) for file in files}
    if len(shapes) != 1:
        raise InvalidInputError(
            f"{directory} must hold sequences of one length and one mesh to be one file, found "
            f"(manipulations, vertices, independent hands) {sorted(shapes)}"
        )
    ((steps, vertices, independent),) = shapes
    if independent or not vertices:
        raise InvalidInputError(
            f"{directory} must have vertices and one displacement for both hands: the authors' "
            "format knows nothing else"
        )
    count = len(reader)
    save_npz(
        path,
        {
            "states": _stream(reader, (count, steps + 1, vertices, 3), _surface),
            "picks": _stream(reader, (count, steps, 2, 2), lambda s: s.picks),
            "moves": _stream(reader, (count, steps, 2), lambda s: s.moves),
        },
    )
    return count


def _surface(sequence: ClothSequence) -> NDArray[Any]:
    surface = sequence.upper_surface
    assert surface is not None
    return surface


def _stream(
    reader: SequenceReader,
    shape: tuple[int, ...],
    part: Callable[[ClothSequence], NDArray[Any]],
) -> StreamedArray:
    return StreamedArray(shape, np.dtype(np.float32), (part(s)[None] for s in reader))


def _shards(files: list[SequenceFile]) -> Iterator[SequenceShard]:
    """Put the sequences of files into shards of ours; one shard holds one length and mesh."""
    first = 0
    for _, alike in itertools.groupby(files, key=lambda file: (file.steps, file.vertices)):
        rows = _rows(list(alike), first)
        while chunk := list(itertools.islice(rows, SHARD_SIZE)):
            names = {file.path.name: file for file, _ in chunk}
            arrays = {
                key: np.stack([entry[key] for _, entry in chunk]) for key in sorted(chunk[0][1])
            }
            first += len(chunk)
            yield SequenceShard(arrays, (), _provenance(list(names.values())))


def _rows(
    files: list[SequenceFile], first: int
) -> Iterator[tuple[SequenceFile, dict[str, NDArray[Any]]]]:
    index = itertools.count(first)
    for file in files:
        order = _order(file)
        for sequence in read_sequences(file, FieldOfView()):
            assert sequence.states is not None
            yield (
                file,
                {
                    "grids": sequence.packed_grids,
                    "states": sequence.states[:, order].astype(np.float16),
                    "picks": sequence.picks,
                    "moves": sequence.moves,
                    "indices": np.array(next(index), dtype=np.int64),
                },
            )


def _order(file: SequenceFile) -> NDArray[np.int64]:
    """Find the row-major order of a file's vertices from its first sequences."""
    side = round(file.vertices**0.5)
    if file.meta or file.independent or side**2 != file.vertices or side < 2:
        raise InvalidInputError(
            f"{file.path} should be of the authors' format, with the vertices of a square mesh "
            "and one displacement for both hands"
        )
    some = itertools.islice(read_sequences(file, FieldOfView()), SHARD_SIZE)
    starts = [np.asarray(s.states[0], np.float64) for s in some if s.states is not None]
    return vertex_order(np.stack(starts), side) if starts else np.arange(file.vertices)


def _provenance(files: list[SequenceFile]) -> dict[str, Any]:
    side = round(files[0].vertices ** 0.5)
    length = SPAN * FieldOfView().half_extent
    return {
        "source": "imported from the authors' format",
        "files": {file.path.name: _sha256(file.path) for file in files},
        "cloth": {"vertices": [side, side], "side_lengths": [length, length], "thickness": 0.0},
        "field_of_view": asdict(FieldOfView()),
    }


def _sha256(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
