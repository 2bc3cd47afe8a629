"""One step of the cloth by small-step XPBD.

Each step is cut into many substeps with one Gauss-Seidel sweep each (Macklin et al., "Small Steps
in Physics Simulation", 2019). Constraint stiffnesses are given as compliances (Macklin et al.,
"XPBD", 2016), scaled by vertex mass over squared substep.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from emd_cloth_sim.contact import (
    collide_with_desk,
    collide_with_self,
    find_candidates,
    remember_sides,
    restore_sides,
)
from emd_cloth_sim.edge_contact import collide_edges, find_edge_candidates
from emd_core.frames import FloatArray


@njit(cache=True)
def integrate(
    position: FloatArray,
    previous: FloatArray,
    velocity: FloatArray,
    gravity: FloatArray,
    keep: float,
    max_speed: float,
    substep: float,
) -> None:
    """Advance the vertices freely, with damping (`keep` of the velocity) and a speed cap."""
    for v in range(position.shape[0]):
        square = 0.0
        for k in range(3):
            velocity[v, k] = (velocity[v, k] + substep * gravity[k]) * keep
            square += velocity[v, k] * velocity[v, k]
        scale = 1.0
        if square > max_speed * max_speed:
            scale = max_speed / math.sqrt(square)
        for k in range(3):
            previous[v, k] = position[v, k]
            position[v, k] += substep * scale * velocity[v, k]


@njit(cache=True)
def hold_lengths(
    position: FloatArray, pairs: np.ndarray, lengths: FloatArray, compliance: float
) -> None:
    """Pull pairs of equal masses to their rest lengths; `compliance` is scaled, no unit."""
    factor = 1.0 / (2.0 + compliance)
    for c in range(pairs.shape[0]):
        a = pairs[c, 0]
        b = pairs[c, 1]
        x = position[b, 0] - position[a, 0]
        y = position[b, 1] - position[a, 1]
        z = position[b, 2] - position[a, 2]
        length = math.sqrt(x * x + y * y + z * z)
        if length < 1e-9:
            continue
        pull = factor * (1.0 - lengths[c] / length)
        position[a, 0] += pull * x
        position[a, 1] += pull * y
        position[a, 2] += pull * z
        position[b, 0] -= pull * x
        position[b, 1] -= pull * y
        position[b, 2] -= pull * z


@njit(cache=True)
def resist_shear(
    position: FloatArray, corners: np.ndarray, length: float, compliance: float
) -> None:
    """Pull the legs of right-angled triangles to a right angle.

    The constraint is the legs' dot product over the `length` of a leg. Unlike springs along the
    diagonals it does not resist folding along them.
    """
    for n in range(corners.shape[0]):
        a = corners[n, 0]
        b = corners[n, 1]
        c = corners[n, 2]
        ux = (position[b, 0] - position[a, 0]) / length
        uy = (position[b, 1] - position[a, 1]) / length
        uz = (position[b, 2] - position[a, 2]) / length
        vx = (position[c, 0] - position[a, 0]) / length
        vy = (position[c, 1] - position[a, 1]) / length
        vz = (position[c, 2] - position[a, 2]) / length
        dot = ux * vx + uy * vy + uz * vz
        legs = ux * ux + uy * uy + uz * uz + vx * vx + vy * vy + vz * vz
        pull = -length * dot / (2.0 * (legs + dot) + compliance)
        position[b, 0] += pull * vx
        position[b, 1] += pull * vy
        position[b, 2] += pull * vz
        position[c, 0] += pull * ux
        position[c, 1] += pull * uy
        position[c, 2] += pull * uz
        position[a, 0] -= pull * (ux + vx)
        position[a, 1] -= pull * (uy + vy)
        position[a, 2] -= pull * (uz + vz)


@njit(cache=True)
def limit_sharpness(position: FloatArray, pairs: np.ndarray, shortest: FloatArray) -> None:
    """Keep pairs of vertices at least `shortest` apart, so that no fold is sharper than that."""
    for c in range(pairs.shape[0]):
        a = pairs[c, 0]
        b = pairs[c, 1]
        x = position[b, 0] - position[a, 0]
        y = position[b, 1] - position[a, 1]
        z = position[b, 2] - position[a, 2]
        square = x * x + y * y + z * z
        if square >= shortest[c] * shortest[c] or square < 1e-18:
            continue
        push = 0.5 * (shortest[c] / math.sqrt(square) - 1.0)
        position[a, 0] -= push * x
        position[a, 1] -= push * y
        position[a, 2] -= push * z
        position[b, 0] += push * x
        position[b, 1] += push * y
        position[b, 2] += push * z


@njit(cache=True)
def resist_bending(position: FloatArray, triples: np.ndarray, compliance: float) -> None:
    """Pull three vertices in a row towards a straight line (quadratic bending energy)."""
    factor = 1.0 / (6.0 + compliance)
    for c in range(triples.shape[0]):
        a = triples[c, 0]
        b = triples[c, 1]
        d = triples[c, 2]
        for k in range(3):
            push = factor * (position[a, k] - 2.0 * position[b, k] + position[d, k])
            position[a, k] -= push
            position[b, k] += 2.0 * push
            position[d, k] -= push


@njit(cache=True)
def pull_to_hands(
    position: FloatArray,
    held: np.ndarray,
    start: FloatArray,
    end: FloatArray,
    progress: float,
    reach: FloatArray,
) -> None:
    """Move held vertices to their place in the hand, as far as the grip's force allows.

    `reach` has a row for every held vertex: the longest move in all, and the longest downwards.
    """
    for c in range(held.shape[0]):
        v = held[c]
        x = start[c, 0] + progress * (end[c, 0] - start[c, 0]) - position[v, 0]
        y = start[c, 1] + progress * (end[c, 1] - start[c, 1]) - position[v, 1]
        z = start[c, 2] + progress * (end[c, 2] - start[c, 2]) - position[v, 2]
        z = max(z, -reach[c, 1])
        way = math.sqrt(x * x + y * y + z * z)
        scale = 1.0
        if way > reach[c, 0]:
            scale = reach[c, 0] / way
        position[v, 0] += scale * x
        position[v, 1] += scale * y
        position[v, 2] += scale * z


@njit(cache=True)
def update_velocity(
    position: FloatArray, previous: FloatArray, velocity: FloatArray, substep: float
) -> float:
    """Take the velocity from the motion of the substep; returns the longest way, metres."""
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
def advance_step(
    position: FloatArray,
    previous: FloatArray,
    velocity: FloatArray,
    edges: np.ndarray,
    edge_lengths: FloatArray,
    right_angles: np.ndarray,
    leg: float,
    spans: np.ndarray,
    shortest_spans: FloatArray,
    triples: np.ndarray,
    compliances: FloatArray,
    gravity: FloatArray,
    damping: float,
    max_speed: float,
    substep: float,
    first: int,
    substeps: int,
    held: np.ndarray,
    held_start: FloatArray,
    held_end: FloatArray,
    held_reach: FloatArray,
    triangles: np.ndarray,
    broad: tuple,
    triangle_boxes: FloatArray,
    candidates: tuple,
    kept: tuple,
    edge_broad: tuple,
    edge_boxes: FloatArray,
    edge_candidates: tuple,
    contact_values: FloatArray,
    contact_state: FloatArray,
) -> int:
    """Run substeps `first` to `substeps` of one step.

    `contact_values` holds thickness, margin, triangle radius, friction between layers and with
    the desk; `contact_state` holds the number of candidates (-1: none searched yet) and the way
    travelled since their search. Returns the first substep not done: less than `substeps` only if
    the candidate lists are too short; the caller enlarges them and calls again.
    """
    keep = math.exp(-damping * substep)
    thickness, margin, radius = contact_values[0], contact_values[1], contact_values[2]
    edge_thickness = contact_values[5]
    for s in range(first, substeps):
        if contact_state[0] < 0.0 or contact_state[1] > 0.8 * margin:
            kept_count = remember_sides(
                position, triangles, candidates, int(max(contact_state[0], 0.0)), kept
            )
            count = find_candidates(
                position,
                triangles,
                thickness + margin,
                thickness,
                radius,
                broad,
                triangle_boxes,
                candidates,
            )
            restore_sides(candidates, count, kept, kept_count)
            edge_count = 0
            if edge_thickness > 0.0:
                edge_count = find_edge_candidates(
                    position,
                    edges,
                    edge_thickness + margin,
                    edge_thickness,
                    contact_values[6],
                    edge_broad,
                    edge_boxes,
                    edge_candidates,
                )
            contact_state[0] = count if edge_count >= 0 else -1
            contact_state[1] = 0.0
            contact_state[2] = edge_count
            if contact_state[0] < 0.0:
                return s
        integrate(position, previous, velocity, gravity, keep, max_speed, substep)
        pull_to_hands(position, held, held_start, held_end, (s + 1.0) / substeps, held_reach)
        resist_bending(position, triples, compliances[2])
        limit_sharpness(position, spans, shortest_spans)
        resist_shear(position, right_angles, leg, compliances[1])
        hold_lengths(position, edges, edge_lengths, compliances[0])
        collide_with_self(
            position,
            previous,
            triangles,
            candidates,
            int(contact_state[0]),
            contact_state[1],
            thickness,
            contact_values[3],
        )
        collide_edges(
            position,
            edges,
            edge_candidates,
            int(contact_state[2]),
            contact_state[1],
            edge_thickness,
        )
        collide_with_desk(position, previous, 0.5 * thickness, contact_values[4])
        contact_state[1] += 2.0 * update_velocity(position, previous, velocity, substep)
    return substeps
