"""Follows a table that moves slowly, and tells when it has jumped."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from emd_core.frames import FloatArray
from emd_core.value_ranges import bounded, check_ranges
from emd_perception.config import PlaneConfig
from emd_perception.table_frame import refine_table_frame
from emd_perception.table_plane import TablePlane


@dataclass(frozen=True)
class TrackerConfig:
    """What counts as drift and what as a jump.

    Attributes:
        time_constant: Seconds in which the followed table comes 63 % nearer to the measured one.
        max_tilt: Measured tables tilted by more than this against the followed one, radians, are
            not followed.
        max_offset: Nor those higher or lower by more than this, metres.
        jump_frames: So many of them in a row are a jump, fewer a blunder.
    """

    time_constant: float = bounded(1.0, 0.0, 60.0)
    max_tilt: float = bounded(0.015, 1e-4, 0.5)
    max_offset: float = bounded(0.006, 1e-4, 0.5)
    jump_frames: int = bounded(5, 1, 1000)

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            InvalidInputError: If a value is out of its range.
        """
        check_ranges(self)


class TableState(StrEnum):
    """What the tracker makes of the table."""

    UNSEEN = "not measured yet"
    FOLLOWED = "followed"
    DOUBTED = "one measurement differs"
    JUMPED = "jumped"


class TableTracker:
    """Corrects known extrinsics by the table's measured plane, frame by frame.

    Drift may add up to any amount as long as each measurement is near the table followed so far.
    After a jump the followed table stays where it was, for x and y may have moved too; it goes on
    if the table comes back, else the camera must be calibrated anew.

    Attributes:
        state: What the last measurements were.
        tilt: Of the last measurement against the table followed, radians.
        offset: Height of the last measurement over the table followed, metres.
        drift: Height of the table followed over that of the start, metres.
        jumps: How many jumps there were.
        blunders: How many measurements were not followed.
    """

    def __init__(self, transform_camera_to_table: FloatArray, config: TrackerConfig) -> None:
        """Start from known extrinsics, shape (4, 4)."""
        self._start = transform_camera_to_table.copy()
        self._transform = transform_camera_to_table.copy()
        self._before = self._transform
        self._config = config
        self._stamp: float | None = None
        self._doubted = 0
        self.state = TableState.UNSEEN
        self.tilt, self.offset, self.drift = 0.0, 0.0, 0.0
        self.jumps, self.blunders = 0, 0

    @property
    def transform_camera_to_table(self) -> FloatArray:
        """Extrinsics with the tilt and height of the table followed, shape (4, 4)."""
        return self._transform.copy()

    def transform_for(self, stamp: float) -> FloatArray:
        """The same as they were before the frame of this stamp was measured.

        A frame that is processed twice is seen from the same place twice.
        """
        return (self._before if stamp == self._stamp else self._transform).copy()

    def update(self, plane_coefficients: FloatArray, stamp: float) -> TableState:
        """Take a measurement; one with the stamp of the last changes nothing.

        Args:
            plane_coefficients: a, b, c, d in the camera optical frame, metres.
            stamp: Time of the frame, seconds; a clock that jumps does not matter.
        """
        if stamp == self._stamp:
            return self.state
        plane = TablePlane(np.asarray(plane_coefficients, dtype=np.float64), 1.0)
        limits = PlaneConfig(max_tilt=math.pi / 2, max_offset=1e3)
        measured = refine_table_frame(self._transform, plane, limits)
        self.tilt, self.offset = measured.tilt, measured.offset
        # The first table may differ as much from what is known as one frame's correction may.
        allowed = PlaneConfig() if self.state is TableState.UNSEEN else self._config
        near = measured.tilt <= allowed.max_tilt and abs(measured.offset) <= allowed.max_offset
        self._before = self._transform
        if near:
            self._follow(measured.transform_camera_to_table, stamp)
        else:
            self._doubt()
        self._stamp = stamp
        return self.state

    def _follow(self, measured: FloatArray, stamp: float) -> None:
        gain = 1.0
        if self._stamp is not None and self._config.time_constant > 0.0:
            elapsed = min(max(stamp - self._stamp, 0.0), 1.0)
            gain = 1.0 - math.exp(-elapsed / self._config.time_constant)
        # Both planes are near each other: their mean, made a unit normal again, lies between.
        row = (1.0 - gain) * self._transform[2] + gain * measured[2]
        row /= np.linalg.norm(row[:3])
        limits = PlaneConfig(max_tilt=math.pi / 2, max_offset=1e3)
        followed = refine_table_frame(self._transform, TablePlane(row, 1.0), limits)
        self._transform = followed.transform_camera_to_table
        self.drift = refine_table_frame(self._start, TablePlane(row, 1.0), limits).offset
        self._doubted = 0
        self.state = TableState.FOLLOWED

    def _doubt(self) -> None:
        self._doubted += 1
        self.blunders += 1
        if self._doubted == self._config.jump_frames:
            self.jumps += 1
        jumped = self._doubted >= self._config.jump_frames
        self.state = TableState.JUMPED if jumped else TableState.DOUBTED
