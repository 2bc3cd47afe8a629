"""What a cloth must offer to be simulated in lockstep with a robot."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from emd_core.frames import FloatArray


class SimulatedCloth(Protocol):
    """A deformable sheet on the desk, held by up to two hands (0 and 1)."""

    @property
    def positions_in_table(self) -> FloatArray:
        """Vertices of the mid-surface, shape (V, 3), metres, table frame; a copy."""

    @property
    def triangles(self) -> NDArray[np.int32]:
        """Vertex indices, shape (T, 3), counter-clockwise seen from the cloth's upper side."""

    @property
    def thickness(self) -> float:
        """Distance that two layers keep, metres."""

    @property
    def settled(self) -> bool:
        """Whether nothing moves noticeably; only meaningful while no hand moves."""

    def grasp(self, hand: int, transform_tool_to_table: FloatArray) -> int:
        """Close a hand at its tool frame; returns how many vertices it holds, 0 if it missed."""

    def move_hand(self, hand: int, transform_tool_to_table: FloatArray) -> None:
        """Say where the hand will be at the end of the next `advance`."""

    def release(self, hand: int) -> None:
        """Open a hand."""

    def advance(self, duration: float) -> None:
        """Simulate `duration` seconds, carrying what the hands hold along their motion."""
