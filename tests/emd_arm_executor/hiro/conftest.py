"""A tiny cloth and a robot world for the tests of the simulated cell."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from emd_arm_executor.hiro.world import HiroWorld
from emd_core.frames import FloatArray
from emd_core.simulated_cloth import Jaws


class RigidCloth:
    """A flat sheet that notes what is done to it; it holds whatever a hand grasps over it."""

    def __init__(self, side: float = 0.4, height: float = 0.0015, cells: int = 4) -> None:
        """Lay a square of `cells` x `cells` quads at a height of its mid-surface."""
        ticks = np.linspace(-side / 2, side / 2, cells + 1)
        x, y = np.meshgrid(ticks, ticks, indexing="ij")
        self.points = np.stack([x.ravel(), y.ravel(), np.full(x.size, height)], axis=1)
        corners = np.arange(x.size).reshape(x.shape)
        a, b, c, d = corners[:-1, :-1], corners[1:, :-1], corners[1:, 1:], corners[:-1, 1:]
        pairs = [np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)]
        self._triangles = np.concatenate([p.reshape(-1, 3) for p in pairs]).astype(np.int32)
        self.log: list[tuple[str, int]] = []
        self.hand_poses: dict[int, FloatArray] = {}
        self.jaws: dict[int, Jaws] = {}
        self.held = [0, 0]
        self.time = 0.0
        self.at_rest = True

    @property
    def positions_in_table(self) -> FloatArray:
        """Vertices of the mid-surface."""
        return self.points.copy()

    @property
    def triangles(self) -> NDArray[np.int32]:
        """Vertex indices, counter-clockwise from above."""
        return self._triangles

    @property
    def thickness(self) -> float:
        """Thickness, metres."""
        return 0.003

    @property
    def settled(self) -> bool:
        """Whatever the test says."""
        return self.at_rest

    def grasp(self, hand: int, transform_tool_to_table: FloatArray, jaws: Jaws) -> int:
        """Hold one vertex if the tool is over the sheet and near the desk."""
        self.log.append(("grasp", hand))
        self.hand_poses[hand], self.jaws[hand] = transform_tool_to_table, jaws
        position = transform_tool_to_table[:3, 3]
        self.held[hand] = int(np.abs(position[:2]).max() < 0.2 and abs(position[2]) < 0.05)
        return self.held[hand]

    def held_count(self, hand: int) -> int:
        """What it took, unless the test says that it slipped out."""
        return self.held[hand]

    def move_hand(self, hand: int, transform_tool_to_table: FloatArray) -> None:
        """Note the pose."""
        self.hand_poses[hand] = transform_tool_to_table

    def release(self, hand: int) -> None:
        """Note the opening of a hand that holds something."""
        if self.held[hand]:
            self.log.append(("release", hand))
        self.held[hand] = 0

    def advance(self, duration: float) -> None:
        """Let time pass."""
        self.time += duration


@pytest.fixture
def cloth() -> RigidCloth:
    """A 0.40 m square flat on the desk, 3 mm thick."""
    return RigidCloth()


@pytest.fixture
def make_cloth() -> type[RigidCloth]:
    """The class of the tiny cloth, for other sizes and heights."""
    return RigidCloth


@pytest.fixture
def world() -> Iterator[HiroWorld]:
    """A robot in its observing posture."""
    with HiroWorld() as robot:
        yield robot
