"""The published figures of HIRO that its model is built from; metres, kilograms, degrees.

Frames: WAIST has x forward, y left, z up. At zero angles every joint frame is parallel to WAIST,
except that each arm is rolled by 15 degrees about x at its root. Only the left side is listed; the
right side mirrors it in y. Joint origins, limits and speeds are those of the HIRO model in
rtmros_hironx (start-jsk) and of the OpenHRP model in hironx-interface; masses and inertias are
from the latter, the only complete set; sizes are bounding boxes of the published links, rounded to
primitives here. LARM_JOINT3 is mirrored as in the OpenHRP and NEXTAGE models: the COLLADA
model gives the left arm the right arm's limits.
"""

from __future__ import annotations

from dataclasses import dataclass, field

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class JointFigures:
    """One revolute joint.

    Attributes:
        name: Joint name; the child link is called `name` + "_Link".
        parent: Parent link.
        origin: Joint origin in the parent link's frame, metres.
        axis: Joint axis in the joint's frame.
        lower: Lower position limit, degrees.
        upper: Upper position limit, degrees.
        speed: Largest speed, degrees per second.
        effort: Largest torque, newton metres. No torque is published; see `make_urdf`.
        roll: Turn of the joint frame about the parent's x, degrees.
    """

    name: str
    parent: str
    origin: Vector
    axis: Vector
    lower: float
    upper: float
    speed: float
    effort: float
    roll: float = 0.0


@dataclass(frozen=True)
class Inertia:
    """Mass, centre of mass and inertia tensor of a link about that centre, in link axes.

    Attributes:
        mass: Kilograms.
        centre: Centre of mass in the link's frame, metres.
        tensor: ixx, iyy, izz, ixy, ixz, iyz, kg m^2.
    """

    mass: float
    centre: Vector
    tensor: tuple[float, float, float, float, float, float]


@dataclass(frozen=True)
class Shape:
    """A primitive that stands for (a part of) a link.

    Attributes:
        kind: "box" (`size` = full lengths), "cylinder" (`size` = radius, length along z) or
            "sphere" (`size` = radius).
        size: Lengths, metres.
        centre: Centre in the link's frame, metres.
        colour: Name of a colour of `COLOURS`.
        rpy: Roll, pitch, yaw of the shape in the link's frame, degrees.
        collides: Whether the shape is solid too; else it is only drawn.
        drawn: Whether the shape is drawn.
    """

    kind: str
    size: tuple[float, ...]
    centre: Vector
    colour: str = "white"
    rpy: Vector = (0.0, 0.0, 0.0)
    collides: bool = True
    drawn: bool = True


COLOURS: dict[str, tuple[float, float, float]] = {
    "white": (0.90, 0.90, 0.88),
    "grey": (0.55, 0.57, 0.60),
    "dark": (0.20, 0.21, 0.23),
    "black": (0.06, 0.06, 0.07),
    "blue": (0.16, 0.30, 0.55),
    "steel": (0.72, 0.74, 0.76),
}

# No joint torque of HIRO is published: 100 Nm is what its MoveIt model writes. The fingers carry
# grams, and no speed or torque of theirs is published either; both are choices of this model.
ARM_EFFORT = 100.0
HAND_EFFORT = 10.0
HAND_SPEED = 120.0

TORSO_AND_HEAD: tuple[JointFigures, ...] = (
    JointFigures("CHEST_JOINT0", "WAIST", (0, 0, 0), (0, 0, 1), -163, 163, 130, ARM_EFFORT),
    JointFigures(
        "HEAD_JOINT0", "CHEST_JOINT0_Link", (0, 0, 0.5695), (0, 0, 1), -70, 70, 150, ARM_EFFORT
    ),
    JointFigures(
        "HEAD_JOINT1", "HEAD_JOINT0_Link", (0, 0, 0), (0, 1, 0), -20, 70, 250, ARM_EFFORT
    ),
)

LEFT_ARM: tuple[JointFigures, ...] = (
    JointFigures(
        "LARM_JOINT0",
        "CHEST_JOINT0_Link",
        (0, 0.145, 0.370296),
        (0, 0, 1),
        -88,
        88,
        172,
        ARM_EFFORT,
        roll=-15,
    ),
    JointFigures(
        "LARM_JOINT1", "LARM_JOINT0_Link", (0, 0, 0), (0, 1, 0), -140, 60, 133, ARM_EFFORT
    ),
    JointFigures(
        "LARM_JOINT2", "LARM_JOINT1_Link", (0, 0.095, -0.25), (0, 1, 0), -158, 0, 229, ARM_EFFORT
    ),
    JointFigures(
        "LARM_JOINT3", "LARM_JOINT2_Link", (-0.03, 0, 0), (0, 0, 1), -105, 165, 150, ARM_EFFORT
    ),
    JointFigures(
        "LARM_JOINT4", "LARM_JOINT3_Link", (0, 0, -0.235), (0, 1, 0), -100, 100, 250, ARM_EFFORT
    ),
    JointFigures(
        "LARM_JOINT5",
        "LARM_JOINT4_Link",
        (-0.04, 0, -0.09),
        (1, 0, 0),
        -163,
        163,
        300,
        ARM_EFFORT,
    ),
)

# Limits: the soft limits used at AIST. The +-30 degrees of the published models are a placeholder
# that would keep the jaws from opening beyond 74 mm.
FINGERS: tuple[JointFigures, ...] = (
    JointFigures(
        "HAND_JOINT0",
        "ARM_JOINT5_Link",
        (-0.0299, -0.033, 0),
        (0, 0, 1),
        -109,
        68,
        HAND_SPEED,
        HAND_EFFORT,
    ),
    JointFigures(
        "HAND_JOINT1",
        "HAND_JOINT0_Link",
        (-0.0419, 0, 0),
        (0, 0, 1),
        -150,
        90,
        HAND_SPEED,
        HAND_EFFORT,
    ),
    JointFigures(
        "HAND_JOINT2",
        "ARM_JOINT5_Link",
        (-0.0299, 0.033, 0),
        (0, 0, 1),
        -109,
        68,
        HAND_SPEED,
        HAND_EFFORT,
    ),
    JointFigures(
        "HAND_JOINT3",
        "HAND_JOINT2_Link",
        (-0.0419, 0, 0),
        (0, 0, 1),
        -150,
        90,
        HAND_SPEED,
        HAND_EFFORT,
    ),
)

# Mass of the fingers: the models' placeholder (10 g each, far too large a tensor, harmless here).
FINGER_INERTIA = Inertia(0.01, (0, 0, 0), (1e-4, 1e-4, 1e-4, 0, 0, 0))

INERTIAS: dict[str, Inertia] = {
    "WAIST": Inertia(
        3.11081,
        (-0.00038809, 1.66e-06, 0.16466),
        (0.0347318, 0.0347482, 0.00438238, 5.78e-06, -3.342e-05, 6.25e-07),
    ),
    "CHEST_JOINT0_Link": Inertia(
        6.20761,
        (-0.00493378, -0.00097682, 0.344052),
        (0.0639575, 0.0310845, 0.0501107, -0.00022833, 0.00011172, 6.48e-05),
    ),
    "HEAD_JOINT0_Link": Inertia(
        0.317929,
        (-2.292e-05, 0.00547848, -0.00784016),
        (0.00027682, 0.00013009, 0.00020954, 3e-08, -3.3e-07, -1.092e-05),
    ),
    "HEAD_JOINT1_Link": Inertia(
        0.0808593,
        (5.02e-06, -0.0166777, 0.0163153),
        (8.07e-05, 3.025e-05, 6.637e-05, -3e-08, 0, -1.277e-05),
    ),
    "LARM_JOINT0_Link": Inertia(
        1.32626,
        (-0.00226388, -0.00521383, 0.0156081),
        (0.00207537, 0.00240295, 0.00141912, 0.00011276, 8.927e-05, -4.57e-05),
    ),
    "LARM_JOINT1_Link": Inertia(
        1.14898,
        (-5.236e-05, 0.0583134, -0.107061),
        (0.0154168, 0.0147117, 0.00126575, 9.75e-07, 3.515e-06, 0.00213705),
    ),
    "LARM_JOINT2_Link": Inertia(
        0.577518,
        (-2.254e-05, 0.00167107, -0.0715116),
        (0.00143966, 0.00141763, 0.0001972, -3e-07, 1.2e-06, -7.596e-05),
    ),
    "LARM_JOINT3_Link": Inertia(
        0.457418,
        (-1.788e-05, -0.00395812, -0.202731),
        (0.00069205, 0.00068903, 0.00013509, 3e-08, 5.2e-07, -1.915e-05),
    ),
    "LARM_JOINT4_Link": Inertia(
        0.418434,
        (0.00243131, 0.00379733, -0.0577036),
        (0.00052016, 0.00050569, 0.00014004, 1.69e-06, 7.9e-06, -5.377e-05),
    ),
    "LARM_JOINT5_Link": Inertia(
        1.05156,
        (-0.048476, -3.2e-06, -0.0388988),
        (0.00194072, 0.00209392, 0.00035788, 1.1e-07, -0.00042482, 1.2e-07),
    ),
}
