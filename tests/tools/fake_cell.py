"""A cell that obeys at once, for tests without ROS."""

from __future__ import annotations

import asyncio
from typing import Any

import numpy as np

from emd_arm_executor.hiro.description import OBSERVE, URDF_PATH
from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.mesh import flat_positions
from emd_console.cell_port import Check, Execution, Observation, Plan
from emd_console.example import Example
from emd_console.goals import neat_goal
from emd_console.motion import (
    DESCRIPTION,
    JOINT_STATE,
    JOINTS,
    STRING,
    TYPES,
    MotionLog,
    MotionMessage,
)
from emd_core.errors import CancelledError, CellError
from emd_core.manipulation import Manipulation
from emd_core.voxel_grid import VoxelGrid, voxelise

HEAD = OBSERVE.by_joint()
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
    who = "ada (operator)"
    return Example(observation(), after, HALF, HALF, kind, who, after.grid, motion=motion())


def motion(seconds: float = 2.0) -> MotionLog:
    """HIRO turns its left shoulder from 0 to 1 rad: joint states at 50 Hz and three phases."""
    log = MotionLog()
    store = TYPES.types
    log.add(_message(DESCRIPTION, STRING, 0, store[STRING](data=URDF_PATH.read_text())))
    time, header = store["builtin_interfaces/msg/Time"], store["std_msgs/msg/Header"]
    for tick in range(round(50 * seconds) + 1):
        at, share = tick / 50, tick / (50 * seconds)
        stamp = header(time(int(at), round(1e9 * (at % 1))), "")
        joints, nothing = {**HEAD, "LARM_JOINT0": share}, np.zeros(0)
        positions = np.array(list(joints.values()))
        state = store[JOINT_STATE](stamp, list(joints), positions, nothing, nothing)
        log.enter(("approach", "carry", "home")[min(int(3 * share), 2)], round(1e9 * at))
        log.add(_message(JOINTS, JOINT_STATE, at, state))
    return log


def _message(topic: str, kind: str, seconds: float, content: Any) -> MotionMessage:
    data = bytes(TYPES.serialize_cdr(content, kind))
    return MotionMessage(topic, kind, round(1e9 * seconds), data)


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

    async def execute(self, manipulation: Manipulation) -> Execution:
        """Fold in half, at once or never."""
        self._note("execute")
        if self.slow:
            await self._stopped.wait()
            raise CancelledError("as asked")
        self._grid = neat_goal("half").grid
        return Execution(manipulation, motion())

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
