"""A picture of a data set: sequences seen from above, with arrows for the manipulations."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from emd_cloth_sim.top_view import top_view
from emd_core.cloth_sequence import ClothSequence
from emd_core.errors import InvalidInputError
from emd_core.sequence_reader import SequenceReader, read_sequences
from emd_core.whole_file import whole_file

LEAST_VIEW = 1.1
HAND_COLOURS = ("#d62728", "#1f3fd6")


def draw_contact_sheet(directory: Path, path: Path, rows: int = 8) -> None:
    """Draw sequences spread evenly over the data set, a row each, as a PNG.

    The pictures have x downwards and y to the right, as the head camera sees the desk; the frame
    is the field of view. The cloth's two sides have different colours. An arrow goes from each
    grasp to where it would be carried.

    Raises:
        InvalidInputError: If the directory holds no sequence or a file cannot be read.
    """
    chosen = list(_spread(SequenceReader([directory]), rows))
    if not chosen:
        raise InvalidInputError(f"{directory} holds no sequence to draw")
    columns = max(len(sequence) for sequence, _ in chosen) + 1
    figure = Figure(figsize=(2.2 * columns, 2.3 * len(chosen)), dpi=100, layout="constrained")
    axes = figure.subplots(len(chosen), columns, squeeze=False)
    for row, (sequence, vertices) in zip(axes, chosen, strict=True):
        _draw_sequence(row, sequence, vertices)
    with whole_file(path) as temporary:
        figure.savefig(temporary, format="png", metadata={"Software": None})


def _spread(
    reader: SequenceReader, count: int
) -> Iterator[tuple[ClothSequence, tuple[int, int] | None]]:
    """Give evenly spread sequences with the mesh of each, None if the file does not tell it."""
    places = set(np.linspace(0, len(reader) - 1, min(count, len(reader))).round().astype(int))
    first = 0
    for file in reader.files:
        here = places & set(range(first, first + file.count))
        if here:
            mesh = _mesh(file.meta, file.vertices)
            sequences = read_sequences(file, reader.field_of_view, first)
            for place, sequence in enumerate(sequences, start=first):
                if place in here:
                    yield sequence, mesh
        first += file.count


def _mesh(meta: dict[str, Any], count: int) -> tuple[int, int] | None:
    n_x, n_y = meta.get("cloth", {}).get("vertices", (0, 0))
    return (n_x, n_y) if n_x * n_y == count and count else None


def _draw_sequence(
    row: NDArray[Any], sequence: ClothSequence, mesh: tuple[int, int] | None
) -> None:
    surface = sequence.upper_surface
    view = _view(sequence)
    for step, axis in enumerate(row):
        axis.set_axis_off()
        if step > len(sequence):
            continue
        if surface is None:
            heights = sequence.grids[step].sum(axis=2).astype(float)
            axis.imshow(heights, extent=(-1, 1, 1, -1), cmap="Greys")
        else:
            axis.imshow(top_view(surface[step], mesh, view), extent=(-view, view, view, -view))
        axis.plot([-1, 1, 1, -1, -1], [-1, -1, 1, 1, -1], color="#555555", linewidth=0.7)
        axis.set_xlim(-view, view)
        axis.set_ylim(view, -view)
        if step < len(sequence):
            _draw_arrows(axis, sequence, step)
        title = f"sequence {sequence.index}" if step == 0 else f"after {step}"
        axis.set_title(title, fontsize=8, pad=2)


def _moves(sequence: ClothSequence) -> NDArray[np.float32]:
    """Displacement of each hand, shape (L, 2, 2), normalised."""
    moves = sequence.moves
    return moves if sequence.independent else np.repeat(moves[:, None], 2, axis=1)


def _view(sequence: ClothSequence) -> float:
    """How far the pictures of a sequence reach, so that all of it is in them."""
    ends = [np.nanmax(np.abs(sequence.picks + _moves(sequence)))]
    if sequence.states is not None:
        ends.append(np.abs(sequence.states[..., :2]).max())
    return 1.05 * float(max(LEAST_VIEW, *ends))


def _draw_arrows(axis: Axes, sequence: ClothSequence, step: int) -> None:
    for hand, colour in enumerate(HAND_COLOURS):
        x, y = sequence.picks[step, hand]
        if np.isnan(x):
            continue
        move = _moves(sequence)[step, hand]
        axis.annotate(
            "",
            xy=(y + move[1], x + move[0]),
            xytext=(y, x),
            arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.4, "shrinkA": 0},
            annotation_clip=False,
        )
        axis.plot(y, x, "o", color=colour, markersize=3)
