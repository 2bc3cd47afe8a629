"""Parameters of the perception node that are not the core's."""

from __future__ import annotations

from dataclasses import dataclass

from emd_core.value_ranges import bounded, check_ranges

AT_START = ("reliable", "sync_tolerance", "calibration")


@dataclass(frozen=True)
class PerceptionNodeConfig:
    """How the node takes frames.

    Attributes:
        max_rate: Frames processed a second at most while streaming; 0: as many as it can.
        reliable: Whether lost images are sent again. Without, any camera driver will do, but on a
            busy machine images are lost: one is larger than Fast DDS's shared memory. Set at
            the start.
        sync_tolerance: Largest difference of the stamps of colour and depth, seconds. Set at the
            start.
        capture_frames: Depth frames that a capture fuses unless the request says otherwise.
        capture_timeout: Seconds that a capture waits for them unless the request says otherwise.
        camera_timeout: Seconds without a pair of images after which the camera counts as lost.
        calibration: File that `./cell calibrate` wrote; it goes before the topic camera/pose.
            Set at the start.
    """

    max_rate: float = bounded(30.0, 0.0, 1000.0)
    reliable: bool = False
    sync_tolerance: float = bounded(0.02, 0.0, 1.0)
    capture_frames: int = bounded(10, 1, 1000)
    capture_timeout: float = bounded(40.0, 0.1, 3600.0)
    camera_timeout: float = bounded(2.0, 0.1, 3600.0)
    calibration: str = ""

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            InvalidInputError: If a value is out of its range.
        """
        check_ranges(self)
