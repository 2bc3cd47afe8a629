"""The hands' path of the authors' public generator, quirks included.

An arc through the air that begins beside the grasp, so that the hand jumps to it within one frame,
and ends 0.25 above it; then the hand sinks while the cloth is let go. Lengths are normalised as in
the generator; time runs in its frames (aislab/emd_cloth_data_generator_blender, rounded path).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray


@dataclass(frozen=True)
class ReferencePathConfig:
    """How the authors' generator moves its hand.

    Attributes:
        lift: Height over the grasp at which the path ends, normalised.
        speed: Way along the chord in a frame, normalised.
        frame: Duration of a frame, seconds.
        frames_before: Frames for which the hand holds still after the grasp.
        sink: Part of `lift` by which the hand sinks in the frame before it opens.
        frames_after: Frames from the opening until the state is taken, at rest or not.
        frames_more: Most frames that a cloth gets beyond these while it is stretched too far to be
            believed (ours).
        hand_speed: Fastest that the hand moves, m/s: a longer way than it makes in a frame, such
            as the jump at the beginning, takes more time (ours).
        half_extent: Metres of a normalised unit.
    """

    lift: float = 0.25
    speed: float = 0.05
    frame: float = 0.01761
    frames_before: int = 0
    sink: float = 0.3
    frames_after: int = 12
    frames_more: int = 24
    hand_speed: float = 0.9
    half_extent: float = 0.40 / 1.4

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            InvalidInputError: If a value is out of its range.
        """
        for name in ("lift", "speed", "frame", "hand_speed", "half_extent"):
            value = getattr(self, name)
            if not math.isfinite(value) or value <= 0:
                raise InvalidInputError(f"{name} must be positive and finite, got {value}")
        if not 0.0 <= self.sink <= 1.0:
            raise InvalidInputError(f"sink must be in 0..1, got {self.sink}")
        for name in ("frames_before", "frames_after", "frames_more"):
            if getattr(self, name) < 0:
                raise InvalidInputError(f"{name} must not be negative, got {getattr(self, name)}")


def reference_offsets(displacement: FloatArray, config: ReferencePathConfig) -> FloatArray:
    """Give the hand's places from the grasp to the release, one a frame.

    Args:
        displacement: Nominal displacement (2,), metres, not zero.
        config: The path's constants.

    Returns:
        Offsets from the grasp (F, 3), metres: where the hand is after each frame; the hand opens
        after the last.

    Raises:
        InvalidInputError: If the displacement is zero: the generator divides by its length.
    """
    nominal = np.asarray(displacement, dtype=np.float64) / config.half_extent
    length = float(np.hypot(*nominal))
    if length <= 0.0:
        raise InvalidInputError("the reference's path needs a displacement that is not zero")
    lift = config.lift
    chord = math.hypot(lift, length)
    frames = math.ceil(chord / config.speed)
    diagonal = math.hypot(chord, lift * chord / length)
    radius = 0.5 * diagonal
    turn = 2.0 * math.asin(min(0.5 * chord / radius, 1.0))
    angle = turn * np.arange(frames + 1) / frames
    along = radius - 0.5 * length * np.cos(angle)
    arc = np.column_stack([*(along[:, None] * nominal / length).T, radius * np.sin(angle)])
    still = np.zeros((config.frames_before, 3))
    sunk = arc[-1] - [0.0, 0.0, config.sink * lift]
    return np.concatenate([still, arc, sunk[None]]) * config.half_extent
