"""What the console asks of a cell, whoever answers: the ROS graph, or a test."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from emd_console.motion import MotionLog
from emd_core.frames import FloatArray
from emd_core.manipulation import Manipulation
from emd_core.voxel_grid import VoxelGrid


@dataclass(frozen=True)
class Observation:
    """What perception made of frames taken on request.

    Attributes:
        grid: The cloth's voxel grid.
        mask: Shape (H, W), 255 where cloth was found.
        points_in_table: Of the cloth's surface, shape (N, 3), metres.
        quality: 0..1.
        reason: Why the quality is what it is.
        picture: The camera's colour image then, shape (H, W, 3), or None.
        cloth_states: The simulator's own vertices, shape (V, 3), metres; None with a real robot.
    """

    grid: VoxelGrid
    mask: NDArray[np.uint8]
    points_in_table: FloatArray
    quality: float
    reason: str
    picture: NDArray[np.uint8] | None = None
    cloth_states: FloatArray | None = None


@dataclass(frozen=True)
class Plan:
    """What the planner answered.

    Attributes:
        manipulations: In the order of execution.
        predicted_grids: Expected state after each.
        predicted_loss: Of the last prediction to the goal (paper, eq. 1).
        expected_error: Voxel MSE to be expected of the outcome.
        failure_probability: That the outcome is farther from the goal than half of what the
            present state is, 0..1; NaN if unknown.
        planning_seconds: What planning took.
    """

    manipulations: tuple[Manipulation, ...]
    predicted_grids: tuple[VoxelGrid, ...]
    predicted_loss: float
    expected_error: float
    failure_probability: float
    planning_seconds: float


@dataclass(frozen=True)
class Check:
    """What the executor would do for a manipulation.

    Attributes:
        executed: The manipulation with the points that the hands take at the hem.
        arms: Which arm takes which of its used points.
        directions: Horizontal unit vectors along which the hands come, shape (N, 2).
        carry_paths: Where each hand goes while it carries, shape (M, 3), metres, table frame.
        duration: Of the whole motion, seconds.
    """

    executed: Manipulation
    arms: tuple[str, ...]
    directions: FloatArray
    carry_paths: tuple[FloatArray, ...] = field(default_factory=tuple)
    duration: float = 0.0


@dataclass(frozen=True)
class Execution:
    """What became of a manipulation that was carried out.

    Attributes:
        executed: The manipulation with the points at which the hands really grasped.
        motion: What was heard meanwhile; None if nothing was recorded.
    """

    executed: Manipulation
    motion: MotionLog | None = None


class CellPort(Protocol):
    """A cell that can be asked; every answer may be a CellError instead."""

    async def capture(self) -> Observation:
        """Look at the cloth, in frames taken from now on."""

    async def plan(
        self, initial: VoxelGrid, goal: VoxelGrid, steps: int, seed: int, restarts: int
    ) -> Plan:
        """Plan manipulations that turn one state into another; `restarts` 0: the default."""

    async def check(self, manipulation: Manipulation) -> Check:
        """Plan the arms' motion and check it; nothing moves."""

    async def execute(self, manipulation: Manipulation) -> Execution:
        """Carry a manipulation out."""

    async def go_home(self) -> None:
        """Send both arms home."""

    async def reset(self) -> None:
        """Lay a flat cloth before the simulated robot."""

    def stop(self) -> None:
        """Cancel every motion and every search of whoever asked for it; does not wait."""

    def can_reset(self) -> bool:
        """Whether there is a simulation that can be reset."""
