"""What the kernels of a step work on: plain records of arrays and numbers."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from emd_cloth_sim.broad_phase import (
    Candidates,
    Cells,
    allocate_candidates,
    allocate_cells,
)
from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.hinges import cell_hinges
from emd_cloth_sim.mesh import IndexArray, SheetMesh, cell_diagonals
from emd_core.frames import FloatArray

# Way that the cloth may travel before the pairs that can touch are searched again, metres: a
# longer one means more pairs to look at, a shorter one more searches.
CONTACT_MARGIN = 0.004
# Share of the thickness at which edges push each other apart.
EDGE_THICKNESS = 0.5
# Explicit hinges: the square of their fastest swing's frequency in units of rigidity over mass and
# squared spacing (a chequered sheet's), and the phase that may pass between two evaluations.
HINGE_STIFFENING = 32.0
HINGE_PHASE = 0.5
# Places in `ContactMemory.counts`.
CANDIDATES, TRAVELLED, EDGE_CANDIDATES = 0, 1, 2


class ClothState(NamedTuple):
    """Vertices now and at the start of the substep, metres, and their velocities; all (V, 3)."""

    position: FloatArray
    previous: FloatArray
    velocity: FloatArray


class Constraints(NamedTuple):
    """The mesh as the kernels need it; see `SheetMesh`.

    `leg` is the length of the right angles' legs and `shortest_spans` the least distance of each
    span's ends, metres. Diagonals are those of `springs`, `multipliers` a place for each side and
    diagonal, and `mobility` (V,) is 0 for vertices in a rigid grip. A hinge has its rest angle in
    radians and a gain, in 1/m, that makes accelerations of bending rigidity over mass. What a
    config does not use is empty.
    """

    triangles: IndexArray
    edges: IndexArray
    edge_lengths: FloatArray
    right_angles: IndexArray
    leg: float
    spans: IndexArray
    shortest_spans: FloatArray
    triples: IndexArray
    diagonals: IndexArray
    diagonal_lengths: FloatArray
    multipliers: FloatArray
    mobility: FloatArray
    hinges: IndexArray
    hinge_angles: FloatArray
    hinge_gains: FloatArray
    hinge_accelerations: FloatArray


class Held(NamedTuple):
    """Held vertices (H,), their places at the step's start and end (H, 3), and their reach (H, 2).

    The reach is the longest move in a substep that the hand's force allows: in all, and downwards.
    """

    vertices: IndexArray
    start: FloatArray
    end: FloatArray
    reach: FloatArray


class ContactMemory(NamedTuple):
    """Pairs that may touch, and the memory to search them.

    `counts` holds the number of pairs of vertex and triangle (-1: none searched yet), the way
    travelled since the search, and the number of pairs of edges.
    """

    cells: Cells
    candidates: Candidates
    kept: Candidates
    edge_cells: Cells
    edge_candidates: Candidates
    counts: FloatArray


class StepSettings(NamedTuple):
    """Numbers of a step: SI units; compliances times vertex mass over squared substep."""

    substep: float
    substeps: int
    gravity: FloatArray
    damping: float
    max_speed: float
    stretch_compliance: float
    shear_compliance: float
    bending_compliance: float
    thickness: float
    edge_thickness: float
    margin: float
    triangle_radius: float
    longest_edge: float
    cloth_friction: float
    desk_friction: float
    springs: bool
    squeeze_compliance: float
    internal_damping: float
    spring_sweeps: int
    rigid_grip: bool
    hinge_stiffness: float
    hinge_interval: int
    separation: float
    rest_height: float


def constraints_of(mesh: SheetMesh, config: ClothConfig) -> Constraints:
    """Arrange a mesh for the kernels; lengths and angles at rest are the flat sheet's, copies."""
    springs, hinged = config.membrane == "springs", config.bending == "hinges"
    limited = config.sharpest_fold > 0.0
    diagonals, diagonal_lengths = cell_diagonals(mesh)
    hinges, gains = _hinges(config)
    return Constraints(
        mesh.triangles,
        mesh.edges,
        mesh.edge_lengths.copy(),
        mesh.right_angles[: None if not springs else 0],
        math.sqrt(config.spacing[0] * config.spacing[1]),
        mesh.spans[: None if limited else 0],
        config.sharpest_fold * mesh.span_lengths,
        mesh.triples[: None if not hinged else 0],
        diagonals[: None if springs else 0],
        diagonal_lengths.copy(),
        np.zeros(len(mesh.edges) + len(diagonals) if springs else 0),
        np.ones(int(np.prod(config.vertices))),
        hinges,
        np.zeros(len(hinges)),
        gains,
        np.zeros((int(np.prod(config.vertices)) if hinged else 0, 3)),
    )


def _hinges(config: ClothConfig) -> tuple[IndexArray, FloatArray]:
    """Hinges and their gains: rigidity times length of the side over squared width of a cell."""
    if config.bending != "hinges":
        return np.empty((0, 6), np.int32), np.empty(0)
    hinges = cell_hinges(config.vertices)
    x, y = config.spacing
    across_x = (config.vertices[0] - 2) * (config.vertices[1] - 1)
    gains = np.full(len(hinges), 0.5 * x / y**2)
    gains[:across_x] = 0.5 * y / x**2
    return hinges, gains


def contact_memory(mesh: SheetMesh, vertices: int, growth: int = 1) -> ContactMemory:
    """Make memory for contacts; `growth` multiplies the length of the lists."""
    return ContactMemory(
        allocate_cells(len(mesh.triangles)),
        allocate_candidates(16 * growth * vertices),
        allocate_candidates(512),
        allocate_cells(len(mesh.edges)),
        allocate_candidates(32 * growth * vertices),
        np.array([-1.0, 0.0, 0.0]),
    )


def step_settings(config: ClothConfig, substep: float) -> StepSettings:
    """Work out the numbers of a step from the config and the substep in seconds."""
    spacing = max(config.spacing)
    springs = config.membrane == "springs"
    scale = config.vertex_mass / substep**2
    area = config.spacing[0] * config.spacing[1]
    hinge_stiffness = config.bending_rigidity / config.vertex_mass
    bending = area / config.bending_rigidity if config.bending_rigidity > 0 else math.inf
    return StepSettings(
        substep=substep,
        substeps=config.mesh_substeps,
        gravity=np.array(config.gravity, dtype=np.float64),
        damping=config.damping,
        max_speed=config.max_speed,
        stretch_compliance=config.stretch_compliance * scale,
        # A triangle of a weave stores half of the shear energy of its cell.
        shear_compliance=(1.0 if springs else 2.0) * config.shear_compliance * scale,
        bending_compliance=bending * scale,
        thickness=config.thickness,
        edge_thickness=EDGE_THICKNESS * config.thickness * config.edge_contact,
        margin=CONTACT_MARGIN,
        # Corners of a right-angled half cell lie within 2/3 of its median from its centre; the
        # factor allows for a tenth of stretch.
        triangle_radius=1.1 / 3.0 * math.hypot(2.0 * spacing, spacing),
        longest_edge=1.15 * spacing,
        cloth_friction=config.cloth_friction,
        desk_friction=config.desk_friction,
        springs=springs,
        squeeze_compliance=config.squeeze_ratio * config.stretch_compliance * scale,
        internal_damping=config.internal_damping / substep,
        spring_sweeps=config.spring_sweeps,
        rigid_grip=config.rigid_grip,
        hinge_stiffness=hinge_stiffness,
        hinge_interval=_hinge_interval(config, substep),
        separation=(config.separation_speed or math.inf) * substep,
        rest_height=config.rest_height,
    )


def _hinge_interval(config: ClothConfig, substep: float) -> int:
    """Substeps between two evaluations of the hinges: a small share of their fastest swing."""
    if config.bending_rigidity == 0.0:
        return config.mesh_substeps
    stiffness = config.bending_rigidity / config.vertex_mass
    fastest = math.sqrt(HINGE_STIFFENING * stiffness / min(config.spacing) ** 2)
    return int(min(max(HINGE_PHASE / (fastest * substep), 1.0), config.mesh_substeps))
