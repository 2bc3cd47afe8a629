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
from emd_cloth_sim.mesh import IndexArray, SheetMesh, feature_owners
from emd_cloth_sim.planes import Plane, Single, empty_planes, to_plane

# Way that two patches may approach each other before their pairs are searched again, metres: a
# longer one means more pairs to look at, a shorter one more searches.
CONTACT_MARGIN = 0.002
# Way that two layers may approach each other before crossings are looked for, in thicknesses.
UNSEEN_WAY = 0.3
# Share of the thickness at which watched edges push each other apart.
EDGE_THICKNESS = 0.5
MAX_EDGE_PAIRS = 2048
MAX_CROSSINGS_LISTED = 4096
# Places in `ContactMemory.counts`.
PAIRS, CANDIDATES, CLEAN, PUT_BACK, UNSEEN = range(5)

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
    whether the cloth was free of crossings when last looked at, how often a vertex has been put
    back for one, and how far two layers may have approached each other since that look.
    """

    patches: Patches
    segments: Segments
    motion: Motion
    ways: Singles
    candidates: Candidates
    contacts: Contacts
    seen: Patches
    edge_pairs: EdgePairs
    crossings: IndexArray
    counts: NDArray[np.float64]


class StepSettings(NamedTuple):
    """Numbers of a step: SI units; compliances times vertex mass over squared substep.

    Those of stretching and bending are along x and along y.
    `sheet` holds the counts of vertices along x and y, their spacings, and how far apart on the
    flat sheet a vertex and a cell are that may collide.
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
    )


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
        np.empty((MAX_CROSSINGS_LISTED, 5), dtype=np.int32),
        np.array([-1.0, 0.0, 0.0, 0.0, 0.0]),
    )


def step_settings(config: ClothConfig, substep: float) -> StepSettings:
    """Work out the numbers of a step from the config and the substep in seconds."""
    scale = config.vertex_mass / substep**2
    # An edge stands for a strip one spacing wide, three vertices in a row for one cell's bending.
    aspect = config.spacing[0] / config.spacing[1]
    stretch = config.stretch_compliance * scale
    area = config.spacing[0] * config.spacing[1]
    bending = area * scale / max(config.bending_rigidity, 1e-30)
    single = np.float32
    return StepSettings(
        substep=single(substep),
        substeps=config.mesh_substeps,
        gravity=np.array(config.gravity, dtype=np.float32),
        keep_speed=single(math.exp(-config.damping * substep)),
        max_speed=single(config.max_speed),
        stretch_compliance=(single(stretch * aspect), single(stretch / aspect)),
        # A triangle stores half of the shear energy of its cell.
        shear_compliance=single(2.0 * config.shear_compliance * scale),
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
    )
