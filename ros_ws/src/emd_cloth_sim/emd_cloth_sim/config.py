"""What the simulated cloth is made of, and how hands without a robot move it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from emd_cloth_sim.planes import MAX_VERTICES
from emd_core.errors import InvalidInputError

MEMBRANES = ("weave", "springs")
BENDINGS = ("rows", "hinges")


@dataclass(frozen=True)
class ClothConfig:
    """A rectangular sheet and the constants of its simulation, SI units.

    Stiffnesses are those of the continuous sheet, so they do not depend on the mesh. What does
    depend on it is said at `substeps` and `effective_grasp_radius`.

    Attributes:
        side_lengths: Extent along x and y of the flat sheet, metres.
        vertices: Mesh vertices along x and y, 5 to `planes.MAX_VERTICES` each.
        thickness: Distance that two layers keep, metres, whatever the mesh. What is closer on the
            flat sheet than 1.5 of it, or a vertex spacing, does not collide.
        areal_density: kg/m^2. A cotton hand towel has 0.3 to 0.5.
        stretch_compliance: Inverse of the membrane stiffness, m/N.
        shear_compliance: Inverse of the shear stiffness of the weave, m/N. Cotton: 0.01 to 0.1.
        bending_rigidity: N m. Cotton: 0.3e-5 to 5e-5.
        sharpest_fold: How near a fold brings vertices that are two edges or a diagonal apart, as a
            share of their distance on the flat sheet. Sharper folds would pierce themselves.
        desk_friction: Coulomb coefficient between cloth and desk. Below about 0.5 a folded cloth
            slides as a whole rather than folding.
        cloth_friction: Coulomb coefficient between two layers.
        damping: Rate at which air takes velocity away, 1/s.
        gravity: Acceleration in the table frame, m/s^2.
        max_speed: Cap on the speed of a vertex, m/s. With `step` and `substeps` it must keep the
            way of one substep below half a thickness, or layers could jump through each other.
        step: Longest time step between two updates of the hands, seconds.
        substeps: Least number of solver substeps in a `step`.
        vertices_per_substep: Stretch under a given load grows with (vertices / substeps)^2, so a
            mesh has at least one substep for so many vertices of its longer side.
        grasp_radius: Horizontal reach of a closing hand without fingers, metres. The authors'
            generator has 0.025 normalised, 0.0071 m.
        grasp_height_tolerance: Vertical reach up and down: generous, so that a hand takes all
            layers at its spot (paper, IV-B).
        grip_force: Force at which cloth slips after its hand instead of being torn, N.
        press_force: The same downwards: fingertips cannot push slack cloth into a pile, N.
        settle_speed: The cloth rests when no more than one vertex in a thousand is faster, m/s.
        settle_time: For how long it must be so, seconds.
        membrane: `weave`: sides hold their lengths and cells resist shear. `springs`: the
            reference's lattice of damped springs along sides and diagonals (`springs`), the
            diagonals slack when shortened; `stretch_compliance` and `shear_compliance` are then
            those of a side and of a diagonal.
        squeeze_ratio: Compliance of a shortened side over that of a stretched one; `springs` only.
        internal_damping: Retardation time of the springs, seconds; `springs` only.
        strain_limit: Share by which a spring gives way under a pull; longer it does not get. 0: no
            limit; `springs` only.
        squeeze_limit: Share of a side's length on the flat sheet up to which it gives way to a
            squeeze; `springs` only.
        spring_sweeps: Sweeps over the springs in a substep, at least 1: the more, the farther a
            pull is felt within it; `springs` only.
        bending: `rows`: three vertices in a row seek a straight line. `hinges`: cells seek their
            rest angle about the side they share (`hinges`).
        plastic: Whether a manipulation leaves its shape in the cloth: every `take_rest_shape`
            (and a start from given positions) makes the present lengths and angles those of rest.
            Needs `springs` and `hinges`.
        desk_gap: Height over the desk at which the cloth's underside rests, metres: a collision
            margin.
        max_stretch: A state of which more than 1 % of the edges are stretched by a greater share
            than this cannot be believed.
        separation_speed: Fastest that a contact drives cloth that is too near apart, m/s. What
            approaches is stopped at once in any case. 0: no bound.
        rigid_grip: Whether what a hand holds follows it exactly, whatever forces pull; otherwise
            up to `grip_force` and `press_force`.
    """

    side_lengths: tuple[float, float] = (0.40, 0.40)
    vertices: tuple[int, int] = (41, 41)
    thickness: float = 0.003
    areal_density: float = 0.35
    stretch_compliance: float = 1e-3
    shear_compliance: float = 3e-2
    bending_rigidity: float = 6e-6
    sharpest_fold: float = 0.4
    desk_friction: float = 1.0
    cloth_friction: float = 0.4
    damping: float = 5.0
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    max_speed: float = 2.5
    step: float = 1.0 / 240.0
    substeps: int = 12
    vertices_per_substep: float = 5.2
    grasp_radius: float = 0.0075
    grasp_height_tolerance: float = 0.05
    grip_force: float = 0.8
    press_force: float = 0.02
    settle_speed: float = 0.03
    settle_time: float = 0.05
    membrane: str = "weave"
    squeeze_ratio: float = 1.0
    internal_damping: float = 0.0
    strain_limit: float = 0.0
    squeeze_limit: float = 0.0
    spring_sweeps: int = 1
    bending: str = "rows"
    plastic: bool = False
    desk_gap: float = 0.0
    separation_speed: float = 0.0
    rigid_grip: bool = False
    max_stretch: float = 0.03

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            InvalidInputError: If a value is out of its range, or values do not fit each other.
        """
        _check_positive(self, *_POSITIVE)
        _check_not_negative(self, *_NOT_NEGATIVE)
        if len(self.side_lengths) != 2 or min(self.side_lengths) <= 0:
            raise InvalidInputError(f"side_lengths must be two lengths, got {self.side_lengths}")
        if len(self.vertices) != 2 or min(self.vertices) < 5:
            raise InvalidInputError(f"vertices must be two counts >= 5, got {self.vertices}")
        if len(self.gravity) != 3 or not np.isfinite(self.gravity).all():
            raise InvalidInputError(f"gravity must be three finite values, got {self.gravity}")
        if self.membrane not in MEMBRANES or self.bending not in BENDINGS:
            raise InvalidInputError(
                f"membrane must be one of {', '.join(MEMBRANES)} and bending one of "
                f"{', '.join(BENDINGS)}, got {self.membrane!r} and {self.bending!r}"
            )
        if self.plastic and (self.membrane, self.bending) != ("springs", "hinges"):
            raise InvalidInputError(
                "a plastic cloth needs membrane 'springs' and bending 'hinges', as the others "
                f"know only a flat rest shape; got {self.membrane!r} and {self.bending!r}"
            )
        if min(self.substeps, self.spring_sweeps) < 1:
            raise InvalidInputError(
                f"substeps and spring_sweeps must be at least 1, got {self.substeps} and "
                f"{self.spring_sweeps}"
            )
        if self.thickness > 0.25 * min(self.side_lengths):
            raise InvalidInputError(
                f"thickness {self.thickness} m must be at most a quarter of the shorter side of "
                f"{self.side_lengths} m"
            )
        if max(self.vertices) > MAX_VERTICES:
            raise InvalidInputError(
                f"vertices must be at most {MAX_VERTICES} a side, got {self.vertices}"
            )
        if self.max_speed * self.step / self.mesh_substeps > 0.5 * self.thickness:
            raise InvalidInputError(
                f"a vertex at max_speed {self.max_speed} m/s passes more than half the thickness "
                f"{self.thickness} m in one substep; use more substeps or a lower max_speed"
            )

    @property
    def spacing(self) -> tuple[float, float]:
        """Distance of neighbouring vertices along x and y, metres."""
        return (
            self.side_lengths[0] / (self.vertices[0] - 1),
            self.side_lengths[1] / (self.vertices[1] - 1),
        )

    @property
    def vertex_mass(self) -> float:
        """Mass of one vertex, kg."""
        area = self.side_lengths[0] * self.side_lengths[1]
        return self.areal_density * area / (self.vertices[0] * self.vertices[1])

    @property
    def rest_height(self) -> float:
        """Height of the mid-surface of a single layer at rest on the desk, metres."""
        return self.desk_gap + 0.5 * self.thickness

    @property
    def mesh_substeps(self) -> int:
        """Substeps a step for this mesh: `substeps`, or more for a fine one."""
        return max(self.substeps, math.ceil(max(self.vertices) / self.vertices_per_substep))

    @property
    def effective_grasp_radius(self) -> float:
        """Horizontal reach of a hand, metres.

        At least 0.75 of the vertex spacing, so that a hand closing anywhere on the cloth meets a
        vertex however coarse the mesh is.
        """
        return max(self.grasp_radius, 0.75 * max(self.spacing))


@dataclass(frozen=True)
class HandPathConfig:
    """How hands carry cloth when no robot is simulated.

    Attributes:
        lift_height: Highest rise of the arc over the straight line, metres. The authors'
            generator lifts by 0.25 normalised, 0.071 m.
        rise_ratio: Highest rise as a share of the displacement. At most 0.5, so that the hand
            stays in reach of the crease and does not drag the layer below.
        hand_speed: Peak speed along the displacement, m/s.
        min_duration: Shortest carry, seconds.
        release_clearance: Height over the pile at which the hands open, metres.
        settle_time_limit: Longest wait for the cloth to rest after the release, seconds.
    """

    lift_height: float = 0.07
    rise_ratio: float = 0.5
    hand_speed: float = 0.6
    min_duration: float = 0.15
    release_clearance: float = 0.001
    settle_time_limit: float = 2.0

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            InvalidInputError: If a value is out of its range.
        """
        _check_positive(self, "lift_height", "hand_speed", "min_duration")
        _check_not_negative(self, "release_clearance", "settle_time_limit")
        if not 0 < self.rise_ratio <= 0.5:
            raise InvalidInputError(f"rise_ratio must be in (0, 0.5], got {self.rise_ratio}")


_POSITIVE = (
    "thickness",
    "areal_density",
    "max_speed",
    "step",
    "vertices_per_substep",
    "grasp_radius",
    "grasp_height_tolerance",
    "grip_force",
    "press_force",
    "settle_speed",
    "settle_time",
    "squeeze_ratio",
    "max_stretch",
)
_NOT_NEGATIVE = (
    "stretch_compliance",
    "shear_compliance",
    "sharpest_fold",
    "bending_rigidity",
    "desk_friction",
    "cloth_friction",
    "damping",
    "internal_damping",
    "strain_limit",
    "squeeze_limit",
    "desk_gap",
    "separation_speed",
)


def _check_positive(config: object, *names: str) -> None:
    for name in names:
        value = getattr(config, name)
        if not np.isfinite(value) or value <= 0:
            raise InvalidInputError(f"{name} must be positive and finite, got {value}")


def _check_not_negative(config: object, *names: str) -> None:
    for name in names:
        value = getattr(config, name)
        if not np.isfinite(value) or value < 0:
            raise InvalidInputError(f"{name} must be finite and not negative, got {value}")
