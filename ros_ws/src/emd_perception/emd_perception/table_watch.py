"""Keeps an eye on the table: follows its drift, reports jumps, checks the stored calibration."""

from __future__ import annotations

import math

import numpy as np

from emd_core.frames import FloatArray
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.calibration.calibration import Calibration
from emd_perception.calibration.check import CalibrationVerdict, CheckConfig, check_calibration
from emd_perception.health import Health, Level
from emd_perception.table_plane import TablePlane
from emd_perception.table_tracker import TableState, TableTracker, TrackerConfig

_CHECKED_FRAMES = 5  # whose mean plane is compared with the calibration


class TableWatch:
    """Gives the extrinsics for each frame and learns from the table measured in it."""

    def __init__(
        self,
        calibration: Calibration | None = None,
        tracker: TrackerConfig | None = None,
        check: CheckConfig | None = None,
    ) -> None:
        """Start with a stored calibration, if there is one."""
        self.tracker_config = tracker or TrackerConfig()
        self.check_config = check or CheckConfig()
        self._calibration = calibration
        self._known: FloatArray | None = None
        self._tracker: TableTracker | None = None
        self._first_planes: list[FloatArray] = []
        self.verdict: CalibrationVerdict | None = None

    def extrinsics(self, published: FloatArray | None, stamp: float) -> FloatArray | None:
        """Give transform_camera_to_table for a frame, shape (4, 4), or None if nothing is known.

        Args:
            published: The pose that is published, if one is; a stored calibration goes before it.
            stamp: Of the frame, seconds.
        """
        stored = self._calibration
        known = published if stored is None else stored.transform_camera_to_table
        if known is None:
            self._known = self._tracker = None
            return None
        if self._tracker is None or self._known is None or not np.array_equal(known, self._known):
            self._known = known.copy()  # the camera was moved on purpose: follow from there
            self._tracker = TableTracker(known, self.tracker_config)
        return self._tracker.transform_for(stamp)

    def measured(self, plane: FloatArray, camera: PinholeCamera, stamp: float) -> None:
        """Take the table's plane of a frame: a, b, c, d, camera optical frame, metres."""
        if self._tracker is not None:
            self._tracker.update(plane, stamp)
        if self._calibration is None or self.verdict is not None:
            return
        self._first_planes.append(np.asarray(plane, dtype=np.float64))
        if len(self._first_planes) >= _CHECKED_FRAMES:
            mean = np.median(self._first_planes, axis=0)
            mean /= np.linalg.norm(mean[:3])
            self.verdict = check_calibration(
                self._calibration, camera, TablePlane(mean, 1.0), self.check_config
            )

    def health(self) -> list[Health]:
        """Say how the table and the calibration are."""
        reports = [_table_health(self._tracker)]
        if self._calibration is not None:
            reports.append(_calibration_health(self._calibration, self.verdict))
        return reports


def _table_health(tracker: TableTracker | None) -> Health:
    if tracker is None:
        text = "no extrinsics: the table frame lies under the cloth; calibrate the camera"
        return Health("table", Level.WARN, text, {})
    values = {
        "tilt_deg": f"{math.degrees(tracker.tilt):.2f}",
        "offset_mm": f"{1e3 * tracker.offset:.1f}",
        "drift_mm": f"{1e3 * tracker.drift:.1f}",
        "jumps": str(tracker.jumps),
        "measurements_left_out": str(tracker.blunders),
    }
    if tracker.state is TableState.JUMPED:
        text = (
            f"the table has jumped by {1e3 * tracker.offset:.0f} mm and "
            f"{math.degrees(tracker.tilt):.1f} degrees; put it back or calibrate again"
        )
        return Health("table", Level.ERROR, text, values)
    level = Level.WARN if tracker.state is TableState.UNSEEN else Level.OK
    return Health("table", level, f"table: {tracker.state}", values)


def _calibration_health(calibration: Calibration, verdict: CalibrationVerdict | None) -> Health:
    made = {"made": calibration.made, "reprojection_px": f"{calibration.reprojection_error:.2f}"}
    if verdict is None:
        return Health("calibration", Level.WARN, "not checked yet: no table measured", made)
    values = {
        **made,
        "tilt_deg": f"{math.degrees(verdict.tilt):.2f}",
        "offset_mm": f"{1e3 * verdict.offset:.1f}",
    }
    if verdict.complaints:
        return Health("calibration", Level.ERROR, "; ".join(verdict.complaints), values)
    return Health("calibration", Level.OK, "the table is where the calibration has it", values)
