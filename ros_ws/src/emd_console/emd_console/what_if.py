"""What would become of the cloth: a manipulation tried on a simulated copy of it.

The simulation runs in a process of its own, so that the console goes on and can be stopped.
"""

from __future__ import annotations

import asyncio
import io
import sys
from contextlib import suppress

import cv2
import numpy as np
from numpy.typing import NDArray

from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.manipulate import manipulate
from emd_cloth_sim.mesh import flat_positions
from emd_console.cell_port import Observation
from emd_core.errors import CancelledError, CellError, DeadlineError, InvalidInputError
from emd_core.frames import FloatArray
from emd_core.manipulation import Manipulation
from emd_core.voxel_grid import VoxelGrid, voxelise

PATIENCE = 120.0  # seconds; usually it takes a few
_TOLERANCE = 0.12  # of a side's length
_REFUSED = 3  # exit status of a simulation that says why it has no outcome


class WhatIf:
    """Simulates one manipulation at a time."""

    def __init__(self) -> None:
        """Nothing runs yet."""
        self._process: asyncio.subprocess.Process | None = None
        self._stopped = False

    async def outcome(self, seen: Observation, manipulation: Manipulation) -> VoxelGrid:
        """Give the state in which a manipulation would leave the cloth.

        Args:
            seen: The cloth as it lies.
            manipulation: What hands would do, in the table frame.

        Raises:
            InvalidInputError: If its vertices can be neither known nor guessed, or nothing is
                grasped, or the simulation's outcome cannot be believed.
            CancelledError: If it was stopped.
            DeadlineError: If it takes longer than `PATIENCE`.
        """
        content = _packed(
            start=vertices(seen),
            grasps=manipulation.grasp_points_in_table,
            displacement=manipulation.displacement_in_table,
        )
        self._stopped = False
        self._process = process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", __name__),
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
        )
        try:
            answer, said = await asyncio.wait_for(process.communicate(content), PATIENCE)
        except TimeoutError as err:
            raise DeadlineError(
                f"the simulation had no outcome within {PATIENCE:.0f} s; try a shorter drag"
            ) from err
        finally:
            self.stop(asked=False)
            self._process = None
        if self._stopped:
            raise CancelledError("the simulation was ended")
        if process.returncode == _REFUSED:
            raise InvalidInputError(said.decode(errors="replace").strip())
        if process.returncode != 0:
            last = said.decode(errors="replace").strip().rpartition("\n")[2]
            raise CellError(f"the simulation failed: {last or process.returncode}")
        return voxelise(_unpacked(answer)["surface"])

    def stop(self, asked: bool = True) -> None:
        """End what runs; `asked`: somebody wanted it, rather than its own end."""
        self._stopped = self._stopped or asked
        if self._process is not None and self._process.returncode is None:
            with suppress(ProcessLookupError):
                self._process.kill()


def vertices(seen: Observation) -> FloatArray:
    """The cloth's vertices: the simulator's own, or those of a flat cloth where it is seen.

    Returns:
        Of the mesh of the default `ClothConfig`, shape (V, 3), metres, table frame.

    Raises:
        InvalidInputError: If they are unknown and what is seen is no flat cloth.
    """
    config = ClothConfig()
    count = config.vertices[0] * config.vertices[1]
    if seen.cloth_states is not None and len(seen.cloth_states) == count:
        return np.asarray(seen.cloth_states, dtype=np.float64)
    xy = np.asarray(seen.points_in_table, dtype=np.float64)[:, :2]
    if len(xy) < 4:
        raise InvalidInputError("no cloth was seen; look at it first")
    centre, sides, degrees = cv2.minAreaRect((1e3 * xy).astype(np.float32))  # in millimetres
    measured = 1e-3 * np.asarray(sides)
    wanted = np.asarray(config.side_lengths)
    turned = np.abs(measured[::-1] - wanted).sum() < np.abs(measured - wanted).sum()
    measured = measured[::-1] if turned else measured
    if (np.abs(measured - wanted) > _TOLERANCE * wanted).any():
        raise InvalidInputError(
            "a real cloth can be tried out only while it lies flat, as nobody sees its lower "
            f"layers: {wanted[0]:.2f} x {wanted[1]:.2f} m is wanted, got {measured[0]:.2f} x "
            f"{measured[1]:.2f} m; spread it out"
        )
    angle = np.deg2rad(degrees + (90.0 if turned else 0.0))
    cosine, sine = np.cos(angle), np.sin(angle)
    positions = flat_positions(config.vertices, config.side_lengths)
    positions[:, :2] = positions[:, :2] @ np.array([[cosine, sine], [-sine, cosine]])
    positions[:, :2] += 1e-3 * np.asarray(centre)
    return positions


def simulate(start: FloatArray, manipulation: Manipulation) -> FloatArray:
    """Carry a manipulation out on the simulated cloth.

    Args:
        start: Vertices, shape (V, 3), metres, table frame.
        manipulation: In the table frame.

    Returns:
        Its upper surface afterwards, shape (V, 3), metres.

    Raises:
        InvalidInputError: If no hand grasps cloth or the outcome cannot be believed.
    """
    cloth = Cloth.from_positions(start, ClothConfig())
    outcome = manipulate(cloth, manipulation)
    if not any(outcome.held_counts):
        raise InvalidInputError("no hand would grasp cloth there; begin the drag on the cloth")
    if outcome.diagnostics.failure:
        raise InvalidInputError(
            f"the simulation cannot be believed: {outcome.diagnostics.failure}; try another drag"
        )
    return cloth.top_surface_in_table


def _packed(**arrays: FloatArray) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, **arrays)  # type: ignore[arg-type]
    return stream.getvalue()


def _unpacked(content: bytes) -> dict[str, NDArray[np.float64]]:
    with np.load(io.BytesIO(content), allow_pickle=False) as stored:
        return {name: np.asarray(stored[name]) for name in stored.files}


def main() -> int:
    """Read a start and a manipulation from standard input, write the outcome's surface."""
    given = _unpacked(sys.stdin.buffer.read())
    try:
        manipulation = Manipulation(given["grasps"], given["displacement"])
        sys.stdout.buffer.write(_packed(surface=simulate(given["start"], manipulation)))
    except CellError as err:
        print(err, file=sys.stderr)
        return _REFUSED
    return 0


if __name__ == "__main__":
    sys.exit(main())
