"""Colour and depth of one moment."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

from emd_core.ros.conversions import time_from_message


@dataclass(frozen=True)
class FramePair:
    """Messages whose stamps agree, and the calibrations known when they came.

    Attributes:
        colour: Image.
        depth: Image or PointCloud2.
        info: CameraInfo of the colour camera, or None.
        depth_info: CameraInfo of the depth camera, or None.
        arrival: When the pair was complete, seconds of the monotonic clock.
    """

    colour: Any
    depth: Any
    info: Any = None
    depth_info: Any = None
    arrival: float = field(default_factory=time.monotonic)

    @property
    def stamp(self) -> float:
        """Time of the colour image, seconds."""
        return time_from_message(self.colour.header.stamp)
