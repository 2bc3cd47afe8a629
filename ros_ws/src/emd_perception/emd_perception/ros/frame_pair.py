"""Colour and depth of one moment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from emd_core.ros.conversions import time_from_message


@dataclass(frozen=True)
class FramePair:
    """Colour and depth messages whose stamps agree."""

    colour: Any
    depth: Any

    @property
    def stamp(self) -> float:
        """Time of the colour image, seconds."""
        return time_from_message(self.colour.header.stamp)
