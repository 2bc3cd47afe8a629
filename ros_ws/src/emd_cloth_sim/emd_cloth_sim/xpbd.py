"""One step of the cloth by small-step XPBD.

Each step is cut into many substeps with one Gauss-Seidel sweep each (Macklin et al., "Small Steps
in Physics Simulation", 2019). Constraint stiffnesses are given as compliances (Macklin et al.,
"XPBD", 2016), scaled by vertex mass over squared substep.
"""

from __future__ import annotations

import math

from numba import njit

from emd_cloth_sim.constraints import (
    hold_lengths,
    limit_sharpness,
    pull_to_hands,
    resist_bending,
    resist_shear,
)
from emd_cloth_sim.contact import collide_with_desk, collide_with_self
from emd_cloth_sim.contact_search import find_candidates, remember_sides, restore_sides
from emd_cloth_sim.edge_contact import collide_edges, find_edge_candidates
from emd_cloth_sim.hinges import turn_hinges
from emd_cloth_sim.springs import hold_damped_lengths
from emd_cloth_sim.step_data import (
    CANDIDATES,
    EDGE_CANDIDATES,
    TRAVELLED,
    ClothState,
    Constraints,
    ContactMemory,
    Held,
    StepSettings,
)
from emd_core.frames import FloatArray


@njit(cache=True)
def advance_step(
    state: ClothState,
    constraints: Constraints,
    held: Held,
    memory: ContactMemory,
    settings: StepSettings,
    first: int,
) -> int:
    """Run the substeps from `first` on of one step, in place.

    Returns the first substep not done: less than `settings.substeps` only if the candidate lists
    are too short; the caller enlarges them and calls again.
    """
    counts = memory.counts
    for s in range(first, settings.substeps):
        if counts[CANDIDATES] < 0.0 or counts[TRAVELLED] > 0.8 * settings.margin:
            _search_contacts(state.position, constraints, memory, settings)
            if counts[CANDIDATES] < 0.0:
                return s
        if constraints.hinges.shape[0] > 0 and s % settings.hinge_interval == 0:
            turn_hinges(
                state.position,
                constraints.hinges,
                constraints.hinge_angles,
                constraints.hinge_gains,
                settings.hinge_stiffness,
                constraints.hinge_accelerations,
            )
        integrate(state, constraints.hinge_accelerations, settings)
        _satisfy_constraints(state, constraints, held, settings, (s + 1.0) / settings.substeps)
        _collide(state, constraints, memory, settings)
        if settings.rigid_grip:
            pull_to_hands(
                state.position,
                held.vertices,
                held.start,
                held.end,
                (s + 1.0) / settings.substeps,
                held.reach,
            )
        counts[TRAVELLED] += 2.0 * update_velocity(state, settings.substep)
    return settings.substeps


@njit(cache=True)
def integrate(state: ClothState, acceleration: FloatArray, settings: StepSettings) -> None:
    """Advance the vertices freely, with damping and a speed cap.

    `acceleration` (V, 3), m/s^2, comes on top of gravity; (0, 3) if there is none.
    """
    for v in range(acceleration.shape[0]):
        for k in range(3):
            state.velocity[v, k] += settings.substep * acceleration[v, k]
    position, previous, velocity = state.position, state.previous, state.velocity
    keep = math.exp(-settings.damping * settings.substep)
    for v in range(position.shape[0]):
        square = 0.0
        for k in range(3):
            velocity[v, k] = (velocity[v, k] + settings.substep * settings.gravity[k]) * keep
            square += velocity[v, k] * velocity[v, k]
        scale = 1.0
        if square > settings.max_speed * settings.max_speed:
            scale = settings.max_speed / math.sqrt(square)
        for k in range(3):
            previous[v, k] = position[v, k]
            position[v, k] += settings.substep * scale * velocity[v, k]


@njit(cache=True)
def update_velocity(state: ClothState, substep: float) -> float:
    """Take the velocity from the motion of the substep; returns the longest way, metres."""
    position, previous, velocity = state.position, state.previous, state.velocity
    longest = 0.0
    for v in range(position.shape[0]):
        square = 0.0
        for k in range(3):
            way = position[v, k] - previous[v, k]
            velocity[v, k] = way / substep
            square += way * way
        longest = max(longest, square)
    return math.sqrt(longest)


@njit(cache=True)
def _satisfy_constraints(
    state: ClothState,
    constraints: Constraints,
    held: Held,
    settings: StepSettings,
    progress: float,
) -> None:
    """Sweep once over each kind of constraint, the stiffest last."""
    position = state.position
    pull_to_hands(position, held.vertices, held.start, held.end, progress, held.reach)
    resist_bending(position, constraints.triples, settings.bending_compliance)
    limit_sharpness(position, constraints.spans, constraints.shortest_spans)
    if settings.springs:
        _hold_springs(state, constraints, settings)
        return
    resist_shear(position, constraints.right_angles, constraints.leg, settings.shear_compliance)
    hold_lengths(
        position, constraints.edges, constraints.edge_lengths, settings.stretch_compliance
    )


@njit(cache=True)
def _hold_springs(state: ClothState, constraints: Constraints, settings: StepSettings) -> None:
    """Sweep over the damped springs of diagonals, which only pull, and of sides."""
    sides = constraints.edges.shape[0]
    multipliers = constraints.multipliers
    multipliers[:] = 0.0
    for _ in range(settings.spring_sweeps):
        hold_damped_lengths(
            state.position,
            state.previous,
            constraints.mobility,
            constraints.diagonals,
            constraints.diagonal_lengths,
            multipliers[sides:],
            settings.shear_compliance,
            -1.0,
            settings.internal_damping,
        )
        hold_damped_lengths(
            state.position,
            state.previous,
            constraints.mobility,
            constraints.edges,
            constraints.edge_lengths,
            multipliers[:sides],
            settings.stretch_compliance,
            settings.squeeze_compliance,
            settings.internal_damping,
        )


@njit(cache=True)
def _collide(
    state: ClothState, constraints: Constraints, memory: ContactMemory, settings: StepSettings
) -> None:
    """Resolve contacts; the desk comes last, so that nothing ever sinks into it."""
    counts = memory.counts
    collide_with_self(
        state.position,
        state.previous,
        constraints.triangles,
        memory.candidates,
        int(counts[CANDIDATES]),
        counts[TRAVELLED],
        settings.thickness,
        settings.cloth_friction,
        settings.separation,
    )
    collide_edges(
        state.position,
        constraints.edges,
        memory.edge_candidates,
        int(counts[EDGE_CANDIDATES]),
        counts[TRAVELLED],
        settings.edge_thickness,
    )
    collide_with_desk(
        state.position,
        state.previous,
        settings.rest_height,
        settings.desk_friction,
        settings.separation,
    )


@njit(cache=True)
def _search_contacts(
    position: FloatArray,
    constraints: Constraints,
    memory: ContactMemory,
    settings: StepSettings,
) -> None:
    """Search the pairs that can touch before the cloth has travelled by the margin."""
    counts = memory.counts
    triangles = constraints.triangles
    known = int(max(counts[CANDIDATES], 0.0))
    kept_count = remember_sides(position, triangles, memory.candidates, known, memory.kept)
    count = find_candidates(
        position,
        triangles,
        settings.thickness + settings.margin,
        settings.thickness,
        settings.triangle_radius,
        memory.cells,
        memory.candidates,
    )
    restore_sides(memory.candidates, count, memory.kept, kept_count)
    edge_count = 0
    if settings.edge_thickness > 0.0:
        edge_count = find_edge_candidates(
            position,
            constraints.edges,
            settings.edge_thickness + settings.margin,
            settings.edge_thickness,
            settings.longest_edge,
            memory.edge_cells,
            memory.edge_candidates,
        )
    counts[CANDIDATES] = count if edge_count >= 0 else -1
    counts[TRAVELLED] = 0.0
    counts[EDGE_CANDIDATES] = edge_count
