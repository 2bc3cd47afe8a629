"""The opening law of HIRO's two-finger hands."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from emd_arm_executor.gripper_law import GripperLaw
from emd_arm_executor.hiro.figures.joints import FINGERS
from emd_arm_executor.hiro.figures.shapes import (
    FINGERTIP,
    NAIL_LENGTH,
    NAIL_WIDTH,
    PAD_OFFSET,
)
from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray
from emd_core.simulated_cloth import Jaws


@dataclass(frozen=True)
class GripperGeometry(GripperLaw):
    """Two parallel fingers, each with a proximal and a distal joint.

    With an opening w the proximal joints turn by a and -a and the distal ones back by as much, so
    that the pads stay parallel: sin a = (w / 2 - `half_gap`) / `finger` (HIRO's client).

    Attributes:
        half_gap: Half the distance between the pads at zero angles, metres.
        finger: Length of a proximal finger, metres.
        closed_width: Opening of the closed jaws, metres.
        open_width: Opening with which a hand approaches the cloth, metres.
    """

    half_gap: float = -FINGERS[0].origin[1] - PAD_OFFSET
    finger: float = -FINGERS[1].origin[0]
    closed_width: float = 0.0
    open_width: float = 0.100

    @property
    def largest_width(self) -> float:
        """Opening at the proximal joints' upper limit, metres."""
        limit = math.radians(FINGERS[0].upper)
        return 2 * (self.half_gap + self.finger * math.sin(limit))

    def joints_from_width(self, width: float) -> FloatArray:
        """Angles of HAND_JOINT0..3 for an opening, shape (4,), radians.

        Args:
            width: Distance between the pads, metres, 0 to `largest_width`.

        Raises:
            InvalidInputError: If the width is out of range.
        """
        if not 0.0 <= width <= self.largest_width + 1e-9:
            raise InvalidInputError(
                f"a gripper opens from 0 to {self.largest_width:.4f} m, got {width}"
            )
        angle = math.asin((width / 2 - self.half_gap) / self.finger)
        return np.array([angle, -angle, -angle, angle])

    def width_from_joints(self, angles: FloatArray) -> float:
        """Distance between the pads for angles of HAND_JOINT0..3, shape (4,), radians; metres."""
        return 2 * self.half_gap + self.finger * (math.sin(angles[0]) - math.sin(angles[2]))

    def tip_advance(self, width: float) -> float:
        """How far the nail tips stand out beyond the tool frame's origin, metres.

        The tips move on a circle as the jaws open: 0 when closed, 3.2 mm at an opening of 32 mm,
        -14 mm (drawn back) at 100 mm. Whoever opens the jaws on the table must allow for it.
        """
        angle = self.joints_from_width(width)[0]
        closed = self.joints_from_width(0.0)[0]
        return self.finger * (math.cos(angle) - math.cos(closed))

    def enclosed(self, opened: float, width: float) -> Jaws:
        """Give what the fingers have come to enclose, in the tool frame.

        The nails bound it: they are narrower than the pads above them, and cloth that they have
        once been under stays above their tips when these rise as the jaws close.

        Args:
            opened: Opening from which the jaws closed, metres.
            width: Opening now, metres.
        """
        deepest = self.tip_advance(float(np.clip(2.0 * self.half_gap, width, opened)))
        half = np.array([width / 2.0, NAIL_WIDTH / 2.0])
        return Jaws(
            np.array([*-half, deepest - NAIL_LENGTH - FINGERTIP]),
            np.array([*half, deepest]),
            slip=NAIL_WIDTH,
        )
