"""`./cell calibrate`: the camera's pose from a bag or the running camera."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console

from emd_cell.bag_frames import bag_frames
from emd_cell.bag_reader import BagTopics
from emd_core.errors import InvalidInputError
from emd_perception.calibration.board import BoardConfig
from emd_perception.calibration.calibrate import BoardPlace, calibrate
from emd_perception.calibration.calibration import Calibration
from emd_perception.frame_input import Frame, InputConfig

LIVE_TIMEOUT = 30.0  # seconds


@dataclass(frozen=True)
class CalibrationRequest:
    """What to calibrate from.

    Attributes:
        bag: A bag in which camera and board are at rest; None: the running camera.
        frames: How many of its frames, at most; the first ones.
        topics: Of the bag.
        config: What the camera gives.
        board: The board.
        place: Where it lies.
    """

    bag: Path | None = None
    frames: int = 10
    topics: BagTopics = field(default_factory=BagTopics)
    config: InputConfig = field(default_factory=InputConfig)
    board: BoardConfig = field(default_factory=BoardConfig)
    place: BoardPlace = field(default_factory=BoardPlace)


def run_calibration(request: CalibrationRequest, out: Path, console: Console) -> Calibration:
    """Calibrate, and store the result.

    Raises:
        InvalidInputError: If the bag or its frames cannot be used, or the board is not seen.
        DeadlineError: If the camera does not give the frames in time.
    """
    if request.frames < 1:
        raise InvalidInputError(f"at least one frame is needed, got {request.frames}")
    with console.status("taking frames") as status:
        if request.bag is not None:
            frames = _frames_of_bag(request)
        else:
            from emd_cell.ros.live_frames import live_frames

            frames = live_frames(
                request.frames,
                request.config,
                LIVE_TIMEOUT,
                lambda count: status.update(f"{count} of {request.frames} frames"),
            )
        status.update("looking for the board")
        sizes = {frame.depth.shape for frame in frames}
        if len(sizes) > 1:
            raise InvalidInputError(f"all frames must have one size, got {sorted(sizes)}")
        found = calibrate(
            [frame.colour for frame in frames],
            [frame.depth for frame in frames],
            frames[-1].camera,
            request.board,
            request.place,
        )
    found.save(out)
    return found


def describe(found: Calibration) -> str:
    """Say in two lines how good a calibration is."""
    return (
        f"{found.corners} corners in {found.frames} frames, "
        f"{found.reprojection_error:.2f} pixels from where the pose has them (root mean square)\n"
        f"the table's depth against the board: {math.degrees(found.tilt):.2f} degrees, "
        f"{1e3 * found.offset:.1f} mm higher; tilt and height are taken from the depth"
    )


def _frames_of_bag(request: CalibrationRequest) -> list[Frame]:
    assert request.bag is not None
    frames: list[Frame] = []
    complaints: list[str] = []
    for item in bag_frames(request.bag, request.topics, request.config):
        if isinstance(item, str):
            complaints.append(item)
        else:
            frames.append(item)
        if len(frames) == request.frames:
            break
    if not frames:
        why = complaints[0] if complaints else "no colour and depth of one moment"
        raise InvalidInputError(f"{request.bag} has no frame that can be used: {why}")
    return frames
