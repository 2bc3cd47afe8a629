"""A cell that obeys at once, for tests without ROS."""

from __future__ import annotations

import asyncio

import numpy as np

from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.mesh import flat_positions
from emd_console.cell_port import Check, Observation, Plan
from emd_console.example import Example
from emd_console.goals import neat_goal
from emd_core.errors import CancelledError, CellError
from emd_core.manipulation import Manipulation
from emd_core.voxel_grid import VoxelGrid, voxelise

HALF = Manipulation(np.array([[-0.2, -0.2], [-0.2, 0.2]]), np.array([0.4, 0.0]))


def flat_grid() -> VoxelGrid:
    """A flat cloth."""
    cloth = ClothConfig()
    return voxelise(flat_positions(cloth.vertices, cloth.side_lengths))


def observation(grid: VoxelGrid | None = None) -> Observation:
    """What perception would say of a state."""
    picture = np.zeros((48, 64, 3), dtype=np.uint8)
    mask = np.zeros((48, 64), dtype=np.uint8)
    return Observation(grid or flat_grid(), mask, np.zeros((5, 3)), 0.9, "cloth found", picture)


def example(kind: str = "taught") -> Example:
    """A half fold."""
    after = observation(neat_goal("half").grid)
    return Example(observation(), after, HALF, HALF, kind, "ada (operator)", after.grid)


class FakeCell:
    """Folds in half whatever it is asked, unless it is to wait or to fail.

    Attributes:
        calls: What was asked for, in order.
        error: Raised by whatever is asked next.
        slow: Whether to execute until it is stopped.
    """

    def __init__(self) -> None:
        """Lay a flat cloth."""
        self.calls: list[str] = []
        self.error: CellError | None = None
        self.slow = False
        self._stopped = asyncio.Event()
        self._grid = flat_grid()

    def _note(self, call: str) -> None:
        self.calls.append(call)
        if self.error is not None:
            error, self.error = self.error, None
            raise error

    async def capture(self) -> Observation:
        """Look."""
        self._note("capture")
        return observation(self._grid)

    async def plan(
        self, initial: VoxelGrid, goal: VoxelGrid, steps: int, seed: int, restarts: int
    ) -> Plan:
        """Plan as many half folds as there are steps."""
        self._note(f"plan {steps} {seed}")
        return Plan((HALF,) * steps, (goal,) * steps, 0.001, 0.002, float("nan"), 0.5)

    async def check(self, manipulation: Manipulation) -> Check:
        """The arms can do anything, coming from the far side unless they are asked otherwise."""
        self._note("check")
        hands = sum(manipulation.used)
        directions = np.array([[1.0, 0.0]] * hands)
        if (asked := manipulation.grasp_directions_in_table) is not None:
            directions = np.where(np.isnan(asked[:hands]), directions, asked[:hands])
        return Check(manipulation, ("left", "right")[:hands], directions)

    async def execute(self, manipulation: Manipulation) -> Manipulation:
        """Fold in half, at once or never."""
        self._note("execute")
        if self.slow:
            await self._stopped.wait()
            raise CancelledError("as asked")
        self._grid = neat_goal("half").grid
        return manipulation

    async def go_home(self) -> None:
        """Go home."""
        self._note("home")

    async def reset(self) -> None:
        """Lay a flat cloth."""
        self._note("reset")
        self._grid = flat_grid()

    def stop(self) -> None:
        """Stop."""
        self.calls.append("stop")
        self._stopped.set()

    def can_reset(self) -> bool:
        """It can."""
        return True
