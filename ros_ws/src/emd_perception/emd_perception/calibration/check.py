"""Does a stored calibration still hold?"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from emd_core.pinhole_camera import PinholeCamera
from emd_core.value_ranges import bounded, check_ranges
from emd_perception.calibration.calibration import Calibration
from emd_perception.table_frame import refine_table_frame
from emd_perception.table_plane import TablePlane

_FOCAL_SHARE = 0.02
_PRINCIPAL_SHARE = 0.02


@dataclass(frozen=True)
class CheckConfig:
    """How much table and camera may differ from the stored calibration.

    Attributes:
        max_tilt: Largest angle between the table seen now and the stored one, radians.
        max_offset: Largest difference of height between both, metres.
    """

    max_tilt: float = bounded(0.0175, 1e-4, 0.5)
    max_offset: float = bounded(0.008, 1e-4, 0.5)

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            InvalidInputError: If a value is out of its range.
        """
        check_ranges(self)


@dataclass(frozen=True)
class CalibrationVerdict:
    """What became of the check.

    Attributes:
        tilt: Between the table seen now and the stored one, radians.
        offset: Height of the one seen now over the stored one, metres.
        complaints: What does not fit, with the remedy; none if the calibration holds.
    """

    tilt: float
    offset: float
    complaints: tuple[str, ...]


def check_calibration(
    calibration: Calibration,
    camera: PinholeCamera,
    plane: TablePlane,
    config: CheckConfig | None = None,
) -> CalibrationVerdict:
    """Compare the camera and the table seen now with those of a stored calibration."""
    settings = config or CheckConfig()
    seen = refine_table_frame(calibration.transform_camera_to_table, plane)
    complaints = []
    if seen.tilt > settings.max_tilt or not abs(seen.offset) <= settings.max_offset:
        complaints.append(
            f"the table seen now is tilted by {math.degrees(seen.tilt):.1f} degrees and "
            f"{1e3 * seen.offset:.0f} mm higher than in the calibration of {calibration.made}; "
            "camera or table have moved: run `./cell calibrate` again"
        )
    stored = calibration.camera
    if (stored.width, stored.height) != (camera.width, camera.height):
        complaints.append(
            f"the camera gives {camera.width} x {camera.height} pixels, the calibration was made "
            f"with {stored.width} x {stored.height}; check its place with `./cell calibrate`"
        )
    elif not _same_intrinsics(stored, camera):
        complaints.append(
            f"the camera's intrinsics are fx {camera.fx:.1f} fy {camera.fy:.1f} cx {camera.cx:.1f}"
            f" cy {camera.cy:.1f}, those of the calibration {stored.fx:.1f} {stored.fy:.1f} "
            f"{stored.cx:.1f} {stored.cy:.1f}; is it the same camera?"
        )
    return CalibrationVerdict(seen.tilt, seen.offset, tuple(complaints))


def _same_intrinsics(one: PinholeCamera, other: PinholeCamera) -> bool:
    focal = np.allclose([one.fx, one.fy], [other.fx, other.fy], rtol=_FOCAL_SHARE)
    difference = np.abs(np.subtract([one.cx, one.cy], [other.cx, other.cy]))
    return bool(focal and difference.max() <= _PRINCIPAL_SHARE * one.width)
