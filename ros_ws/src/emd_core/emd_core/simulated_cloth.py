"""What a cloth must offer to be simulated in lockstep with a robot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from emd_core.frames import FloatArray


@dataclass(frozen=True)
class Jaws:
    """What the fingers of a closing hand enclose, in the tool frame.

    Attributes:
        lower: Least coordinates of the box between the fingers, shape (3,), metres.
        upper: Greatest coordinates, shape (3,), metres.
        slip: How far cloth that is pulled harder than the fingers hold may lag behind them before
            it is out of them, metres.
    """

    lower: FloatArray
    upper: FloatArray
    slip: float


class ClothShape(Protocol):
    """A sheet as it lies or hangs, which is all that a camera needs."""

    @property
    def positions_in_table(self) -> FloatArray:
        """Vertices of the mid-surface, shape (V, 3), metres, table frame; a copy."""

    @property
    def triangles(self) -> NDArray[np.int32]:
        """Vertex indices, shape (T, 3), counter-clockwise seen from the cloth's upper side."""

    @property
    def thickness(self) -> float:
        """Distance that two layers keep, metres."""


@dataclass(frozen=True)
class StillCloth:
    """The shape of a cloth at one moment; a `ClothShape`."""

    positions_in_table: FloatArray
    triangles: NDArray[np.int32]
    thickness: float

    @classmethod
    def of(cls, cloth: ClothShape) -> StillCloth:
        """Keep a cloth's shape of now."""
        return cls(cloth.positions_in_table, cloth.triangles, cloth.thickness)


class SimulatedCloth(ClothShape, Protocol):
    """A deformable sheet on the desk, held by up to two hands (0 and 1)."""

    @property
    def settled(self) -> bool:
        """Whether nothing moves noticeably; only meaningful while no hand moves."""

    def grasp(self, hand: int, transform_tool_to_table: FloatArray, jaws: Jaws) -> int:
        """Close the fingers of a hand; returns how many vertices it holds, 0 if it missed."""

    def held_count(self, hand: int) -> int:
        """How many vertices a hand holds; what slips out of its fingers is lost."""

    def move_hand(self, hand: int, transform_tool_to_table: FloatArray) -> None:
        """Say where the hand will be at the end of the next `advance`."""

    def release(self, hand: int) -> None:
        """Open a hand."""

    def advance(self, duration: float) -> None:
        """Simulate `duration` seconds, carrying what the hands hold along their motion."""
