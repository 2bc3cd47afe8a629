"""Solid primitives for HIRO's links, its nail-like fingertips and its camera; metres, degrees.

Only the left side is listed; the right side mirrors it in y.
"""

from __future__ import annotations

import math
from dataclasses import replace

from emd_arm_executor.hiro.figures.joints import FINGERS, mirror_vector
from emd_arm_executor.hiro.figures.records import Shape

SOLIDS: dict[str, tuple[Shape, ...]] = {
    "WAIST": (Shape("cylinder", (0.063, 0.230), (0, 0, 0.115)),),
    "CHEST_JOINT0_Link": (
        Shape("box", (0.27, 0.34, 0.32), (-0.05, 0, 0.39)),
        # Round shoulders: with the box around them, the forearms of `goOffPose` would touch.
        Shape("cylinder", (0.045, 0.445), (-0.025, 0, 0.509), rpy=(90, 0, 0)),
    ),
    "HEAD_JOINT0_Link": (Shape("box", (0.083, 0.072, 0.051), (-0.012, 0.007, -0.002)),),
    "HEAD_JOINT1_Link": (Shape("box", (0.24, 0.22, 0.095), (-0.02, 0, 0.081)),),
    "LARM_JOINT0_Link": (Shape("cylinder", (0.045, 0.156), (0, 0.007, 0.017)),),
    "LARM_JOINT1_Link": (Shape("cylinder", (0.06, 0.32), (-0.022, 0.115, -0.124)),),
    # The elbow about its axis and the forearm about the next one fill the published box exactly.
    # The box itself would touch the chest where the arms reach the near corners of a cloth.
    "LARM_JOINT2_Link": (
        Shape("cylinder", (0.035, 0.125), (0, 0.0215, 0), rpy=(90, 0, 0)),
        Shape("cylinder", (0.040, 0.153), (-0.030, 0, -0.0765)),
    ),
    "LARM_JOINT3_Link": (Shape("cylinder", (0.045, 0.118), (0, 0.013, -0.199)),),
    "LARM_JOINT4_Link": (Shape("box", (0.075, 0.098, 0.141), (-0.004, 0.022, -0.046)),),
    "LARM_JOINT5_Link": (Shape("box", (0.068, 0.086, 0.075), (-0.005, 0, -0.015)),),
}

# The pads' inner faces lie 17 mm inside the finger's joint, so that the jaws are 32 mm apart at
# zero angles, as the published width law has it (sin a = (w / 2 - 16 mm) / 41.9 mm).
PAD_OFFSET = 0.017
FINGERTIP = 0.030

# The nails: thin steel plates on the pads that reach beyond the fingertips, to slip under a hem
# (paper, IV-B). Their size is not published.
NAIL_LENGTH = 0.028
NAIL_THICKNESS = 0.001
NAIL_WIDTH = 0.020
_NAIL_ROOT = 0.012


def finger_shapes(joint: int) -> tuple[Shape, ...]:
    """Shapes of a hand's link 0..3: 0 and 2 are proximal, 1 and 3 distal; 0 and 1 lie at y < 0."""
    inward = 1.0 if joint in (0, 1) else -1.0
    if joint in (0, 2):
        return (Shape("box", (0.053, 0.021, 0.032), (-0.024, 0.001, 0), "grey"),)
    thickness = 0.025
    centre_y = inward * (PAD_OFFSET - thickness / 2)
    return (Shape("box", (FINGERTIP + 0.0127, thickness, 0.032), (-0.00865, centre_y, 0), "dark"),)


def nail_shape(joint: int) -> Shape:
    """The nail on the distal link 1 or 3, in that link's frame, flush with the pad's face."""
    inward = 1.0 if joint == 1 else -1.0
    length = NAIL_LENGTH + _NAIL_ROOT
    centre_x = -(FINGERTIP + NAIL_LENGTH) + length / 2
    centre_y = inward * (PAD_OFFSET - NAIL_THICKNESS / 2)
    return Shape("box", (length, NAIL_THICKNESS, NAIL_WIDTH), (centre_x, centre_y, 0), "steel")


def tool_offset() -> float:
    """Distance from the wrist's last joint to the nail tips along the fingers, jaws closed, m."""
    palm = -FINGERS[0].origin[0]
    proximal = -FINGERS[1].origin[0]
    # Closed: sin a = -(33 mm - 17 mm) / 41.9 mm, so that the pads' faces meet in the middle.
    closed = math.asin((FINGERS[0].origin[1] + PAD_OFFSET) / proximal)
    return palm + proximal * math.cos(closed) + FINGERTIP + NAIL_LENGTH


# The Kinect stands 0.2237 m above the neck's joint, as on the HIRO at AIST, but 0.089 m further
# forward, on a bracket pitched down: from AIST's place the robot's own forehead would hide the
# near half of the table. With the head pitched by 50 degrees the optical axis then meets the
# middle of the table.
CAMERA_POSITION = (0.050, 0.0, 0.2237)
CAMERA_PITCH_DEGREES = 30.75
# The optical centre lies in front of the body, which therefore never hides its view.
KINECT_BODY = Shape("box", (0.063, 0.276, 0.060), (-0.0395, 0, 0))


def mirror_shape(shape: Shape) -> Shape:
    """Mirror a shape in the plane y = 0."""
    roll, pitch, yaw = shape.rpy
    return replace(shape, centre=mirror_vector(shape.centre), rpy=(-roll, pitch, -yaw))
