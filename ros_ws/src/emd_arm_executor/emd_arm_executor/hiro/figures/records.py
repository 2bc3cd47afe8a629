"""Records for the figures of joints, links and shapes."""

from __future__ import annotations

from dataclasses import dataclass

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
        colour: Name of a colour of `looks.COLOURS`.
        rpy: Roll, pitch, yaw of the shape in the link's frame, degrees.
    """

    kind: str
    size: tuple[float, ...]
    centre: Vector
    colour: str = "grey"
    rpy: Vector = (0.0, 0.0, 0.0)
