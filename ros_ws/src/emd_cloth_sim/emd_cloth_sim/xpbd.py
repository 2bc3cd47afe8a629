"""One step of the cloth by small-step XPBD.

Each step is cut into many substeps with one Gauss-Seidel sweep each (Macklin et al., "Small Steps
in Physics Simulation", 2019). Constraint stiffnesses are given as compliances (Macklin et al.,
"XPBD", 2016), scaled by vertex mass over squared substep.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from emd_cloth_sim.constraints import (
    hold_lengths,
    limit_sharpness,
    pull_to_hands,
    resist_bending,
    resist_shear,
)
from emd_cloth_sim.contact import collide_with_desk, collide_with_self, find_contacts
from emd_cloth_sim.contact_pairs import note_motion
from emd_cloth_sim.contact_search import PAIR_MARGIN, list_pairs, search_pair
from emd_cloth_sim.crossings import EVERYWHERE, find_crossings
from emd_cloth_sim.edge_contact import collide_edges, forget_parted
from emd_cloth_sim.hinges import turn_hinges
from emd_cloth_sim.impact_zones import undo_crossings
from emd_cloth_sim.planes import FAST, Single, load_planes, store_planes
from emd_cloth_sim.springs import hold_damped_lengths
from emd_cloth_sim.step_data import (
    CANDIDATES,
    CLEAN,
    IN_ZONES,
    PAIRS,
    UNSEEN,
    UNSEEN_WAY,
    ClothState,
    Constraints,
    ContactMemory,
    Held,
    Lattice,
    StepSettings,
)

ONE = np.float32(1.0)
# Contacts of two patches are good for so many of their last ways and a little, metres.
HORIZON_WAYS = np.float32(6.0)
LEAST_HORIZON = np.float32(1e-4)


@njit(**FAST)
def advance_step(
    state: ClothState,
    constraints: Constraints,
    held: Held,
    memory: ContactMemory,
    settings: StepSettings,
    first: int,
) -> int:
    """Run the substeps from `first` on of one step, in place.

    Returns the first substep not done: less than `settings.substeps` only if the candidate list
    is too short; the caller enlarges it and calls again.
    """
    counts = memory.counts
    for s in range(first, settings.substeps):
        if not refresh_contacts(state.position, constraints, memory, settings):
            return s
        if constraints.lattice.hinges.shape[0] > 0:
            _swing_hinges(state, constraints.lattice, settings, s)
        integrate(state, settings)
        progress = np.float32((s + 1.0) / settings.substeps)
        pull_to_hands(state.position, held.vertices, held.start, held.end, progress, held.reach)
        _satisfy_constraints(state, constraints, settings)
        _collide(state, memory, settings)
        if settings.rigid_grip:
            pull_to_hands(
                state.position, held.vertices, held.start, held.end, progress, held.reach
            )
        way = update_velocity(state, settings.substep, settings.max_speed, memory.ways)
        note_motion(memory.ways, memory.patches, memory.motion)
        counts[UNSEEN] += 2.0 * way
    if counts[UNSEEN] > UNSEEN_WAY * settings.thickness:
        undo(state, constraints, memory, settings)
    return settings.substeps


@njit(**FAST)
def integrate(state: ClothState, settings: StepSettings) -> None:
    """Advance the vertices freely, with damping."""
    position, previous, velocity = state.position, state.previous, state.velocity
    predicted = state.predicted
    keep, substep = settings.keep_speed, settings.substep
    fall = (
        keep * substep * settings.gravity[0],
        keep * substep * settings.gravity[1],
        keep * substep * settings.gravity[2],
    )
    for v in range(position.shape[0]):
        for k in range(3):
            speed = keep * velocity[v, k] + fall[k]
            velocity[v, k] = speed
            previous[v, k] = position[v, k]
            position[v, k] += substep * speed
            predicted[v, k] = position[v, k]


@njit(**FAST)
def update_velocity(
    state: ClothState, substep: Single, max_speed: Single, ways: NDArray[np.float32]
) -> float:
    """Add to the velocity what constraints and contacts did, up to `max_speed`, m/s.

    Compared with taking it from the whole motion of the substep, this does not lose the digits by
    which a position is longer than its change. Notes the square of each vertex' way in `ways`, and
    returns the longest way, metres.
    """
    position, previous, velocity = state.position, state.previous, state.velocity
    predicted = state.predicted
    rate = ONE / substep
    square = np.float32(0.0)
    for v in range(position.shape[0]):
        x = position[v, 0] - previous[v, 0]
        y = position[v, 1] - previous[v, 1]
        z = position[v, 2] - previous[v, 2]
        for k in range(3):
            velocity[v, k] += rate * (position[v, k] - predicted[v, k])
        ways[v] = x * x + y * y + z * z
        square = max(square, ways[v])
    longest = math.sqrt(square)
    if longest * rate > max_speed:
        _cap_speed(velocity, max_speed)
    return longest


@njit(**FAST)
def _cap_speed(velocity: NDArray[np.float32], max_speed: Single) -> None:
    for v in range(velocity.shape[0]):
        speed = math.sqrt(velocity[v, 0] ** 2 + velocity[v, 1] ** 2 + velocity[v, 2] ** 2)
        if speed > max_speed:
            for k in range(3):
                velocity[v, k] *= max_speed / speed


@njit(**FAST)
def _satisfy_constraints(
    state: ClothState, constraints: Constraints, settings: StepSettings
) -> None:
    """Sweep over each kind of constraint, the stiffest last."""
    rows, columns = constraints.vertices
    planes, shortest = constraints.planes, constraints.shortest
    if settings.rows or settings.weave or shortest[2] > 0:
        load_planes(state.position, planes, rows, columns)
        if settings.rows:
            resist_bending(planes, constraints.bend, rows, columns, settings.bending_compliance)
        if shortest[2] > 0:
            limit_sharpness(planes, rows, columns, shortest[0], shortest[1], shortest[2])
        if settings.weave:
            resist_shear(planes, rows, columns, constraints.leg, settings.shear_compliance)
            hold_lengths(
                planes,
                constraints.length_x,
                constraints.length_y,
                rows,
                columns,
                settings.stretch_compliance,
            )
        store_planes(planes, state.position, rows, columns)
    if not settings.weave:
        _hold_springs(state, constraints.lattice, settings)


@njit(**FAST)
def _swing_hinges(
    state: ClothState, lattice: Lattice, settings: StepSettings, substep: int
) -> None:
    """Accelerate the vertices by the hinges, which are looked up anew every few substeps."""
    acceleration, velocity = lattice.hinge_accelerations, state.velocity
    if substep % settings.hinge_interval == 0:
        turn_hinges(
            state.position,
            lattice.hinges,
            lattice.hinge_angles,
            lattice.hinge_gains,
            settings.hinge_stiffness,
            acceleration,
        )
    for v in range(velocity.shape[0]):
        for k in range(3):
            velocity[v, k] += settings.substep * acceleration[v, k]


@njit(**FAST)
def _hold_springs(state: ClothState, lattice: Lattice, settings: StepSettings) -> None:
    """Sweep over the damped springs of diagonals, which only pull, and of sides."""
    sides = lattice.edges.shape[0]
    multipliers = lattice.multipliers
    multipliers[:] = 0.0
    for _ in range(settings.spring_sweeps):
        hold_damped_lengths(
            state.position,
            state.previous,
            lattice.mobility,
            lattice.diagonals,
            lattice.diagonal_lengths,
            multipliers[sides:],
            settings.shear_compliance,
            -1.0,
            settings.internal_damping,
            settings.spring_limit,
            0.0,
        )
        hold_damped_lengths(
            state.position,
            state.previous,
            lattice.mobility,
            lattice.edges,
            lattice.edge_lengths,
            multipliers[:sides],
            settings.spring_compliance,
            settings.squeeze_compliance,
            settings.internal_damping,
            settings.spring_limit,
            settings.spring_shortest,
        )


@njit(**FAST)
def _collide(state: ClothState, memory: ContactMemory, settings: StepSettings) -> None:
    """Resolve contacts; the desk comes last, so that nothing ever sinks into it."""
    collide_with_self(
        state.position,
        state.previous,
        memory.contacts,
        memory.segments,
        int(memory.counts[PAIRS]),
        settings.thickness,
        settings.cloth_friction,
        settings.separation,
    )
    collide_edges(state.position, memory.edge_pairs, settings.edge_thickness)
    collide_with_desk(
        state.position,
        state.previous,
        settings.rest_height,
        settings.desk_friction,
        settings.separation,
    )


@njit(**FAST)
def undo(
    state: ClothState, constraints: Constraints, memory: ContactMemory, settings: StepSettings
) -> None:
    """Undo crossings that have come up since the last time; if there were some, look on."""
    rows, columns = constraints.vertices
    memory.counts[UNSEEN] = 0.0
    if memory.counts[CLEAN] > 0:
        moved = undo_crossings(
            state.position,
            state.velocity,
            state.safe,
            constraints.lattice.mobility,
            constraints.triangles,
            rows,
            columns,
            memory.seen,
            memory.crossings,
            memory.edge_pairs,
            memory.zones,
            settings.rest_height,
        )
        if moved > 0:
            # What is in a zone has moved farther than the lists allow for.
            memory.counts[PAIRS] = -1.0
            memory.counts[IN_ZONES] += moved
        forget_parted(state.position, memory.edge_pairs, settings.edge_thickness)
        return
    crossings = find_crossings(
        state.position,
        constraints.triangles,
        rows,
        columns,
        memory.seen,
        EVERYWHERE,
        memory.crossings,
    )
    if crossings == 0:
        memory.counts[CLEAN] = 1.0
        state.safe[:] = state.position


@njit(**FAST)
def refresh_contacts(
    position: NDArray[np.float32],
    constraints: Constraints,
    memory: ContactMemory,
    settings: StepSettings,
) -> bool:
    """List the contacts anew, and where patches have moved much, their candidates before.

    Returns false if the lists are too short.
    """
    counts, motion = memory.counts, memory.motion
    # Seldom, and once more if the candidates that are out of date have filled the list.
    for _ in range(2):
        if counts[PAIRS] < 0 or motion.moved.max() > 0.45 * PAIR_MARGIN:
            counts[PAIRS] = list_pairs(
                position,
                constraints.triangles,
                settings.sheet,
                settings.thickness + settings.margin,
                memory.patches,
                memory.segments,
                motion,
            )
            counts[CANDIDATES] = 0
        fresh = counts[CANDIDATES] == 0
        if _refresh_segments(position, constraints, memory, settings):
            return True
        counts[PAIRS] = -1
        if fresh:
            return False
    return False


@njit(**FAST)
def _refresh_segments(
    position: NDArray[np.float32],
    constraints: Constraints,
    memory: ContactMemory,
    settings: StepSettings,
) -> bool:
    counts, motion, segments = memory.counts, memory.motion, memory.segments
    used = int(counts[CANDIDATES])
    for m in range(int(counts[PAIRS])):
        p, q = memory.patches.pairs[m, 0], memory.patches.pairs[m, 1]
        so_far = motion.moved[p] + motion.moved[q]
        last = motion.last[p] + motion.last[q]
        if so_far + last <= segments.good[m]:
            continue
        horizon = HORIZON_WAYS * last + LEAST_HORIZON
        if so_far + horizon >= segments.search[m]:
            used = search_pair(
                position,
                constraints.triangles,
                settings.sheet,
                settings.thickness + settings.margin,
                settings.thickness,
                m,
                memory.patches,
                motion,
                memory.candidates,
                segments,
                used,
            )
            if used < 0:
                return False
        if so_far + horizon < segments.wake[m]:
            segments.touching[m] = 0
            segments.good[m] = min(segments.wake[m], segments.search[m])
            continue
        find_contacts(
            position,
            constraints.triangles,
            constraints.owners,
            memory.candidates,
            segments,
            m,
            so_far,
            horizon,
            settings.thickness,
            memory.contacts,
        )
    counts[CANDIDATES] = used
    return True
