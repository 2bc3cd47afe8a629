"""Pairs colour and depth images of one moment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from emd_core.ros.conversions import time_from_message


@dataclass(frozen=True)
class FramePair:
    """Colour and depth messages taken within the tolerance of each other."""

    colour: Any
    depth: Any

    @property
    def stamp(self) -> float:
        """Time of the colour image, seconds."""
        return time_from_message(self.colour.header.stamp)


class FramePairs:
    """Keeps the newest image of each kind and gives a pair whenever their stamps agree."""

    def __init__(self, tolerance: float) -> None:
        """Pair images whose stamps differ by at most `tolerance` seconds."""
        self._tolerance = tolerance
        self._newest: dict[str, Any] = {}

    def add(self, kind: str, message: Any) -> FramePair | None:
        """Take a message of kind "colour" or "depth"; gives the pair that it completes."""
        self._newest[kind] = message
        if len(self._newest) < 2:
            return None
        pair = FramePair(self._newest["colour"], self._newest["depth"])
        if abs(pair.stamp - time_from_message(pair.depth.header.stamp)) > self._tolerance:
            return None
        self._newest.clear()
        return pair
