"""Replay files of the authors' data format with our cloth.

The format (EMD Net / EM*D Net data generator): an .npz with `states` (N, L + 1, V, 3), `picks`
(N, L, 2, 2) whose unused hands are NaN, and `moves` (N, L, 2), all normalised, for a square mesh
of V = n * n vertices that spans 1.4 when flat.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.config import ClothConfig, HandPathConfig
from emd_cloth_sim.manipulate import ManipulationOutcome, manipulate
from emd_core.errors import InvalidInputError, SimulationError
from emd_core.frames import FieldOfView, FloatArray
from emd_core.manipulation import Manipulation
from emd_core.whole_file import whole_file

SPAN = 1.4
DEFAULT_SIDE = ClothConfig().vertices[0]


@dataclass(frozen=True)
class ReplayReport:
    """What came of a replay.

    Attributes:
        manipulations: How many were performed.
        suspicious: For each state that should not be trusted: sequence, step, and what is wrong.
        missed: Sequence and step of each manipulation of which no hand met our cloth. A later
            step's picks were chosen on the recorded cloth, from which ours may have departed.
    """

    manipulations: int
    suspicious: tuple[tuple[int, int, str], ...]
    missed: tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class Recording:
    """Sequences of the authors' format; see the module's docstring for shapes and units."""

    states: FloatArray
    picks: FloatArray
    moves: FloatArray

    def __post_init__(self) -> None:
        """Check shapes and values.

        Raises:
            InvalidInputError: If shapes do not fit each other, V is not a square, a state or a
                move is not finite, or a hand is half NaN.
        """
        if self.states.ndim != 4 or self.states.shape[1] < 2 or self.states.shape[3] != 3:
            raise InvalidInputError(f"states must be (N, L + 1, V, 3), got {self.states.shape}")
        count, steps = self.states.shape[0], self.states.shape[1] - 1
        if self.picks.shape != (count, steps, 2, 2) or self.moves.shape != (count, steps, 2):
            raise InvalidInputError(
                f"picks and moves must be {(count, steps, 2, 2)} and {(count, steps, 2)} to fit "
                f"the states, got {self.picks.shape} and {self.moves.shape}"
            )
        if self.side**2 != self.states.shape[2] or self.side < 5:
            raise InvalidInputError(
                f"the mesh must be square, of at least 5 x 5 vertices, got {self.states.shape[2]}"
            )
        if not np.isfinite(self.states).all() or not np.isfinite(self.moves).all():
            raise InvalidInputError("states and moves must be finite, got NaN or infinity")
        missing: NDArray[np.bool_] = np.isnan(self.picks)
        if (missing[..., 0] != missing[..., 1]).any() or np.isinf(self.picks).any():
            raise InvalidInputError("a hand's pick must be finite, or NaN in both values")

    @property
    def side(self) -> int:
        """Vertices along one side of the mesh."""
        return round(self.states.shape[2] ** 0.5)


def load_recording(path: Path) -> Recording:
    """Read a file of the authors' format.

    Raises:
        InvalidInputError: If it cannot be read, a key is missing or its content is malformed.
    """
    try:
        with np.load(path, allow_pickle=False) as stored:
            arrays = [np.asarray(stored[key], np.float64) for key in ("states", "picks", "moves")]
    except (OSError, KeyError, ValueError, EOFError) as err:
        raise InvalidInputError(
            f"{path} should be an .npz with states, picks and moves: {err}"
        ) from err
    return Recording(*arrays)


def replay_file(
    input: Path,
    output: Path,
    on_progress: Callable[[int, int], None] | None = None,
    path_config: HandPathConfig | None = None,
    simulated_side: int = DEFAULT_SIDE,
) -> ReplayReport:
    """Perform the picks and moves of a file from its first states, and write what our cloth does.

    The output has the same keys, shapes and vertex order (states float32); it appears whole or
    not at all.

    Args:
        input: File of the authors' format.
        output: Where to write.
        on_progress: Called with the manipulations done and their total.
        path_config: How the hands move.
        simulated_side: A finer mesh than this is simulated at this many vertices a side, and
            interpolated. About 1 s of one core a manipulation at 41, 15 s at 81.

    Raises:
        InvalidInputError: If the input is malformed or its vertices are in no known order.
        SimulationError: If a state becomes NaN.
    """
    recording = load_recording(input)
    side = min(recording.side, simulated_side)
    config = _cloth_config(side)
    order = vertex_order(recording.states[:, 0], recording.side)
    states = np.empty(recording.states.shape, dtype=np.float32)
    states[:, 0] = recording.states[:, 0]
    count, steps = recording.moves.shape[:2]
    suspicious: list[tuple[int, int, str]] = []
    missed: list[tuple[int, int]] = []
    fov = FieldOfView()
    for n in range(count):
        start = resample_sheet(recording.states[n, 0][order], side)
        cloth = Cloth.from_positions(fov.table_from_normalised(start), config)
        for step in range(steps):
            picks, move = recording.picks[n, step], recording.moves[n, step]
            outcome = _perform(cloth, picks, move, path_config)
            if outcome is not None and outcome.diagnostics.failure:
                suspicious.append((n, step, outcome.diagnostics.failure))
            if outcome is not None and not any(outcome.held_counts):
                missed.append((n, step))
            result = fov.normalised_from_table(cloth.positions_in_table)
            states[n, step + 1, order] = resample_sheet(result, recording.side)
            if on_progress:
                on_progress(n * steps + step + 1, count * steps)
    if not np.isfinite(states).all():
        raise SimulationError(f"replaying {input} gave a state that is not finite")
    _write(output, states, recording)
    return ReplayReport(count * steps, tuple(suspicious), tuple(missed))


def resample_sheet(positions: FloatArray, side: int) -> FloatArray:
    """Interpolate a square mesh, shape (n * n, 3), to `side` x `side` vertices, bilinearly."""
    count = round(len(positions) ** 0.5)
    if count == side:
        return positions
    places = np.linspace(0.0, count - 1.0, side)
    low = np.minimum(places.astype(np.int64), count - 2)
    share = (places - low)[:, None]
    grid = positions.reshape(count, count * 3)
    rows = (1.0 - share) * grid[low] + share * grid[low + 1]
    columns = rows.reshape(side, count, 3).transpose(1, 0, 2).reshape(count, side * 3)
    mixed = (1.0 - share) * columns[low] + share * columns[low + 1]
    return np.asarray(mixed.reshape(side, side, 3).transpose(1, 0, 2).reshape(-1, 3))


def _cloth_config(side: int) -> ClothConfig:
    """The default cloth on another mesh; thinner above 81 x 81, as layers must stay closer."""
    default = ClothConfig()
    thickness = min(default.thickness, 0.6 * default.side_lengths[0] / (side - 1))
    return ClothConfig(vertices=(side, side), thickness=thickness)


def vertex_order(first_states: FloatArray, side: int) -> NDArray[np.int64]:
    """Find which vertex of the file is vertex (i, j) of the mesh; shape (V,), row-major.

    Blender numbers the vertices of a subdivided plane in an order of its own, so it is read off a
    flat, axis-parallel first state. Without one the file must be in row-major order.

    Args:
        first_states: Shape (N, V, 3), normalised.
        side: Vertices along one side.

    Raises:
        InvalidInputError: If no first state is flat and the order is not row-major.
    """
    for state in first_states:
        order = _order_of_flat(state, side)
        if order is not None:
            return order
    grid = first_states.reshape(-1, side, side, 3)
    longest = max(np.linalg.norm(np.diff(grid, axis=axis), axis=-1).max() for axis in (1, 2))
    if longest > 1.5 * SPAN / (side - 1):
        raise InvalidInputError(
            "no first state is flat and axis-parallel, and the vertices are not in row-major "
            "order; start a sequence from the flat cloth"
        )
    return np.arange(side * side)


def _order_of_flat(state: FloatArray, side: int) -> NDArray[np.int64] | None:
    low, high = state[:, :2].min(axis=0), state[:, :2].max(axis=0)
    if not np.allclose(high - low, SPAN, atol=0.02) or np.ptp(state[:, 2]) > 0.02:
        return None
    cells = np.rint((state[:, :2] - low) / (high - low) * (side - 1)).astype(np.int64)
    place = cells[:, 0] * side + cells[:, 1]
    order = np.full(side * side, -1)
    order[place] = np.arange(side * side)
    return order if order.min() >= 0 else None


def _perform(
    cloth: Cloth, picks: FloatArray, move: FloatArray, path_config: HandPathConfig | None
) -> ManipulationOutcome | None:
    """Perform one step; None if it uses no hand."""
    used = (bool(np.isfinite(picks[0]).all()), bool(np.isfinite(picks[1]).all()))
    if not any(used):
        return None
    values = np.concatenate([picks.ravel(), move])
    manipulation = Manipulation.from_network(values, used, FieldOfView())
    return manipulate(cloth, manipulation, path_config)


def _write(output: Path, states: NDArray[np.float32], recording: Recording) -> None:
    with whole_file(output) as temporary, open(temporary, "wb") as stream:
        np.savez_compressed(
            stream,
            states=states,
            picks=recording.picks.astype(np.float32),
            moves=recording.moves.astype(np.float32),
        )
