"""What the kernels of a step work on: plain records of arrays and numbers."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from emd_cloth_sim.broad_phase import Patches, make_patches
from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.contact_pairs import (
    Candidates,
    Contacts,
    Motion,
    Segments,
    allocate_candidates,
    allocate_contacts,
    allocate_motion,
    allocate_segments,
)
from emd_cloth_sim.edge_contact import EdgePairs, allocate_edge_pairs
from emd_cloth_sim.hinges import cell_hinges
from emd_cloth_sim.impact_zones import Zones, allocate_zones
from emd_cloth_sim.mesh import IndexArray, SheetMesh, cell_diagonals, feature_owners
from emd_cloth_sim.planes import Plane, Single, empty_planes, to_plane
from emd_core.frames import FloatArray

# Way that two patches may approach each other before their pairs are searched again, metres: a
# longer one means more pairs to look at, a shorter one more searches.
CONTACT_MARGIN = 0.002
# Way that two layers may approach each other before crossings are looked for, in thicknesses.
UNSEEN_WAY = 0.3
# Share of the thickness at which watched edges push each other apart.
EDGE_THICKNESS = 0.5
MAX_EDGE_PAIRS = 8192
# Explicit hinges: the square of their fastest swing's frequency in units of rigidity over mass and
# squared spacing (a chequered sheet's), and the phase that may pass between two evaluations.
HINGE_STIFFENING = 32.0
HINGE_PHASE = 0.5
# In place of infinity, which the kernels' arithmetic does not know.
UNBOUNDED = 1e30
MAX_CROSSINGS_LISTED = 4096
# Places in `ContactMemory.counts`.
PAIRS, CANDIDATES, CLEAN, IN_ZONES, UNSEEN = range(5)

Singles = NDArray[np.float32]


class ClothState(NamedTuple):
    """Vertices now, at the start of the substep, as they would fly freely, and when last clean.

    All (V, 3): positions in metres, velocity in m/s; `safe` is the last state without crossings.
    """

    position: Singles
    previous: Singles
    predicted: Singles
    velocity: Singles
    safe: Singles


class Lattice(NamedTuple):
    """Damped springs and hinges, which may have a rest shape; what a config lacks is empty.

    Attributes:
        edges: Sides of the cells, shape (E, 2), and their rest lengths `edge_lengths`, metres.
        diagonals: Both diagonals of each cell, (D, 2), and `diagonal_lengths`, metres.
        multipliers: A place for each side and diagonal, (E + D,).
        mobility: 0 for vertices in a rigid grip, else 1, (V,).
        hinges: See `hinges.cell_hinges`, (H, 6), and their rest angles `hinge_angles`, radians.
        hinge_gains: Make accelerations of bending rigidity over mass, (H,), 1/m.
        hinge_accelerations: Of the vertices, (V, 3), m/s^2.
    """

    edges: IndexArray
    edge_lengths: FloatArray
    diagonals: IndexArray
    diagonal_lengths: FloatArray
    multipliers: FloatArray
    mobility: FloatArray
    hinges: IndexArray
    hinge_angles: FloatArray
    hinge_gains: FloatArray
    hinge_accelerations: FloatArray


class Constraints(NamedTuple):
    """The mesh as the kernels need it; see `SheetMesh` and `planes`.

    Attributes:
        triangles: Shape (T, 3).
        owners: What each of them owns, see `feature_owners`, shape (T,).
        vertices: Counts along x and y.
        planes: Positions while constraints are satisfied; `bend` is memory like it.
        length_x: Rest lengths along x, and `length_y` along y, at each pair's lower vertex.
        leg: Length of the right angles' legs, metres.
        shortest: How near a fold may bring two edges along x, two along y, and a diagonal, metres.
        lattice: Springs and hinges.
    """

    triangles: IndexArray
    owners: NDArray[np.uint8]
    vertices: tuple[int, int]
    planes: Plane
    bend: Plane
    length_x: Plane
    length_y: Plane
    leg: Single
    shortest: tuple[Single, Single, Single]
    lattice: Lattice


class Held(NamedTuple):
    """Held vertices (H,), their places at the step's start and end (H, 3), and their reach (H, 2).

    The reach is the longest move in a substep that the hand's force allows: in all, and downwards.
    """

    vertices: IndexArray
    start: Singles
    end: Singles
    reach: Singles


class ContactMemory(NamedTuple):
    """Pairs that may touch, and the memory to search them.

    `ways` is the square way of each vertex in the last substep, `seen` what the look for crossings
    works on. `counts` holds the number of pairs of patches (-1: not listed yet) and of candidates,
    whether the cloth was free of crossings when last looked at, how often a vertex has been in an
    impact zone, and how far two layers may have approached each other since that look.
    """

    patches: Patches
    segments: Segments
    motion: Motion
    ways: Singles
    candidates: Candidates
    contacts: Contacts
    seen: Patches
    edge_pairs: EdgePairs
    zones: Zones
    crossings: IndexArray
    counts: NDArray[np.float64]


class StepSettings(NamedTuple):
    """Numbers of a step: SI units; compliances times vertex mass over squared substep.

    With `weave` the membrane is the weave's, else that of the damped springs; with `rows` three
    vertices in a row seek a straight line. Stretching and bending have a compliance along x and
    one along y. `sheet` holds the counts of vertices along x and y, their spacings, and how far
    apart on the flat sheet a vertex and a cell are that may collide.
    """

    substep: Single
    substeps: int
    gravity: Singles
    keep_speed: Single
    max_speed: Single
    stretch_compliance: tuple[Single, Single]
    shear_compliance: Single
    bending_compliance: tuple[Single, Single]
    thickness: Single
    edge_thickness: Single
    margin: Single
    sheet: tuple[int, int, Single, Single, Single]
    cloth_friction: Single
    desk_friction: Single
    rest_height: Single
    separation: Single
    weave: bool
    rows: bool
    rigid_grip: bool
    spring_compliance: float
    squeeze_compliance: float
    internal_damping: float
    spring_limit: float
    spring_shortest: float
    spring_sweeps: int
    hinge_stiffness: float
    hinge_interval: int


def constraints_of(mesh: SheetMesh, config: ClothConfig) -> Constraints:
    """Arrange a mesh for the kernels."""
    rows, columns = config.vertices
    along_x = mesh.edges[:, 1] - mesh.edges[:, 0] == columns
    lengths = np.zeros((2, rows * columns))
    lengths[0, mesh.edges[along_x, 0]] = mesh.edge_lengths[along_x]
    lengths[1, mesh.edges[~along_x, 0]] = mesh.edge_lengths[~along_x]
    spacing_x, spacing_y = config.spacing
    shortest = config.sharpest_fold * np.array(
        [2.0 * spacing_x, 2.0 * spacing_y, math.hypot(spacing_x, spacing_y)]
    )
    return Constraints(
        triangles=mesh.triangles,
        owners=feature_owners(mesh.triangles),
        vertices=config.vertices,
        planes=empty_planes(rows),
        bend=empty_planes(rows),
        length_x=to_plane(lengths[0].reshape(config.vertices)),
        length_y=to_plane(lengths[1].reshape(config.vertices)),
        leg=np.float32(math.sqrt(spacing_x * spacing_y)),
        shortest=(np.float32(shortest[0]), np.float32(shortest[1]), np.float32(shortest[2])),
        lattice=_lattice(mesh, config),
    )


def _lattice(mesh: SheetMesh, config: ClothConfig) -> Lattice:
    """Springs and hinges of a config; at rest they are those of the flat sheet."""
    springs, hinged = config.membrane == "springs", config.bending == "hinges"
    diagonals, diagonal_lengths = cell_diagonals(mesh)
    edge_count, diagonal_count = (len(mesh.edges), len(diagonals)) if springs else (0, 0)
    hinges, gains = _hinges(config) if hinged else (np.empty((0, 6), np.int32), np.empty(0))
    vertices = int(np.prod(config.vertices))
    return Lattice(
        edges=mesh.edges[:edge_count],
        edge_lengths=mesh.edge_lengths[:edge_count].copy(),
        diagonals=diagonals[:diagonal_count],
        diagonal_lengths=diagonal_lengths[:diagonal_count].copy(),
        multipliers=np.zeros(edge_count + diagonal_count),
        mobility=np.ones(vertices),
        hinges=hinges,
        hinge_angles=np.zeros(len(hinges)),
        hinge_gains=gains,
        hinge_accelerations=np.zeros((vertices if hinged else 0, 3)),
    )


def _hinges(config: ClothConfig) -> tuple[IndexArray, FloatArray]:
    """Hinges and their gains: length of the side over squared width of a cell."""
    x, y = config.spacing
    hinges = cell_hinges(config.vertices)
    across_x = (config.vertices[0] - 2) * (config.vertices[1] - 1)
    gains = np.full(len(hinges), 0.5 * x / y**2)
    gains[:across_x] = 0.5 * y / x**2
    return hinges, gains


def contact_memory(config: ClothConfig, growth: int = 1) -> ContactMemory:
    """Make memory for contacts; `growth` multiplies the length of the lists of pairs."""
    patches = make_patches(config.vertices)
    size = 16 * growth * config.vertices[0] * config.vertices[1]
    return ContactMemory(
        patches,
        allocate_segments(len(patches.pairs)),
        allocate_motion(len(patches.cones)),
        np.zeros(config.vertices[0] * config.vertices[1], dtype=np.float32),
        allocate_candidates(size),
        allocate_contacts(size),
        make_patches(config.vertices),
        allocate_edge_pairs(MAX_EDGE_PAIRS),
        allocate_zones(config.vertices[0] * config.vertices[1]),
        np.empty((MAX_CROSSINGS_LISTED, 5), dtype=np.int32),
        np.array([-1.0, 0.0, 0.0, 0.0, 0.0]),
    )


def step_settings(config: ClothConfig, substep: float, substeps: int) -> StepSettings:
    """Work out the numbers of a step from the config, the substep in seconds and their count."""
    scale = config.vertex_mass / substep**2
    # An edge stands for a strip one spacing wide, three vertices in a row for one cell's bending.
    aspect = config.spacing[0] / config.spacing[1]
    stretch = config.stretch_compliance * scale
    area = config.spacing[0] * config.spacing[1]
    bending = area * scale / max(config.bending_rigidity, 1e-30)
    single, weave = np.float32, config.membrane == "weave"
    return StepSettings(
        substep=single(substep),
        substeps=substeps,
        gravity=np.array(config.gravity, dtype=np.float32),
        keep_speed=single(math.exp(-config.damping * substep)),
        max_speed=single(config.max_speed),
        stretch_compliance=(single(stretch * aspect), single(stretch / aspect)),
        # A triangle of a weave stores half of the shear energy of its cell.
        shear_compliance=single((2.0 if weave else 1.0) * config.shear_compliance * scale),
        bending_compliance=(single(bending * aspect**2), single(bending / aspect**2)),
        thickness=single(config.thickness),
        edge_thickness=single(EDGE_THICKNESS * config.thickness),
        margin=single(CONTACT_MARGIN),
        sheet=(
            *config.vertices,
            single(config.spacing[0]),
            single(config.spacing[1]),
            # Neighbours never collide (their distance is kept by lengths and sharpness), nor does
            # what is closer on the flat sheet than two layers are.
            single(max(1.01 * max(config.spacing), 1.5 * config.thickness)),
        ),
        cloth_friction=single(config.cloth_friction),
        desk_friction=single(config.desk_friction),
        rest_height=single(config.rest_height),
        separation=single(config.separation_speed * substep or UNBOUNDED),
        weave=weave,
        rows=config.bending == "rows",
        rigid_grip=config.rigid_grip,
        spring_compliance=stretch,
        squeeze_compliance=config.squeeze_ratio * stretch,
        internal_damping=config.internal_damping / substep,
        spring_limit=1.0 + (config.strain_limit or UNBOUNDED),
        spring_shortest=config.squeeze_limit * min(config.spacing),
        spring_sweeps=config.spring_sweeps,
        hinge_stiffness=config.bending_rigidity / config.vertex_mass,
        hinge_interval=_hinge_interval(config, substep),
    )


def _hinge_interval(config: ClothConfig, substep: float) -> int:
    """Substeps between two evaluations of the hinges: a small share of their fastest swing."""
    if config.bending_rigidity == 0.0:
        return config.mesh_substeps
    stiffness = config.bending_rigidity / config.vertex_mass
    fastest = math.sqrt(HINGE_STIFFENING * stiffness / min(config.spacing) ** 2)
    return int(min(max(HINGE_PHASE / (fastest * substep), 1.0), config.mesh_substeps))
