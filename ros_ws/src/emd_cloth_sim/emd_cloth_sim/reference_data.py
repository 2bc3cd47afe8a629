"""Reference sequences as single manipulations: the state before, what was done, the outcome.

A folder of files of the authors' format (see `replay`). A file may also hold `pert_states`
(N, L, V, 3): outcomes of the same manipulations with the grasp moved by one vertex, which say how
well an outcome can be foretold at all.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from emd_cloth_sim.replay import load_recording, vertex_order
from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray

FIT, HELD_OUT, ALL = "fit", "held-out", "all"
HALVES = (FIT, HELD_OUT, ALL)


@dataclass(frozen=True)
class ReferenceCase:
    """One manipulation of a reference sequence; normalised, vertices in the mesh's order.

    Attributes:
        file: Name of the file, without its folder.
        sequence: Which sequence of the file.
        step: Which manipulation of the sequence.
        half: `fit` or `held-out`.
        before: Vertices before, shape (V, 3).
        picks: Grasp points (2, 2), the unused NaN.
        move: Nominal displacement (2,).
        after: Vertices after, shape (V, 3).
        perturbed: Vertices after the perturbed manipulation, (V, 3), if the file has it.
    """

    file: str
    sequence: int
    step: int
    half: str
    before: FloatArray
    picks: FloatArray
    move: FloatArray
    after: FloatArray
    perturbed: FloatArray | None


def load_cases(folder: Path, half: str = ALL) -> list[ReferenceCase]:
    """Read all manipulations of a folder's files, in the order of their names.

    In that order every other file, from the first on, is of the fit half and the others of the
    held-out half, so a sequence is never split. Manipulations without a hand are left out.

    Raises:
        InvalidInputError: If the half is unknown, or there is no file or a malformed one.
    """
    if half not in HALVES:
        raise InvalidInputError(f"half must be one of {', '.join(HALVES)}, got {half!r}")
    paths = sorted(folder.glob("*.npz"))
    if not paths:
        raise InvalidInputError(
            f"{folder} should be a folder with reference sequences (*.npz), and holds none"
        )
    cases = []
    for place, path in enumerate(paths):
        half_of_file = (FIT, HELD_OUT)[place % 2]
        if half in (ALL, half_of_file):
            cases += _cases_of_file(path, half_of_file)
    return cases


def _cases_of_file(path: Path, half: str) -> list[ReferenceCase]:
    recording = load_recording(path)
    perturbed = _perturbed_states(path, recording.states.shape)
    order = vertex_order(recording.states[:, 0], recording.side)
    return [
        ReferenceCase(
            file=path.name,
            sequence=n,
            step=step,
            half=half,
            before=recording.states[n, step, order],
            picks=recording.picks[n, step],
            move=recording.moves[n, step],
            after=recording.states[n, step + 1, order],
            perturbed=None if perturbed is None else perturbed[n, step, order],
        )
        for n in range(recording.states.shape[0])
        for step in range(recording.moves.shape[1])
        if np.isfinite(recording.picks[n, step]).any() and recording.moves[n, step].any()
    ]


def _perturbed_states(path: Path, shape: tuple[int, ...]) -> FloatArray | None:
    with np.load(path, allow_pickle=False) as stored:
        if "pert_states" not in stored:
            return None
        states = np.asarray(stored["pert_states"], np.float64)
    if states.shape != (shape[0], shape[1] - 1, *shape[2:]) or not np.isfinite(states).all():
        raise InvalidInputError(
            f"{path}: pert_states must be finite and {(shape[0], shape[1] - 1, *shape[2:])} to "
            f"fit the states, got {states.shape}"
        )
    return states
