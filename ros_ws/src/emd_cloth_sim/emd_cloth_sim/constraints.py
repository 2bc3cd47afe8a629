"""The constraints of the cloth: each kernel is one Gauss-Seidel sweep over one kind.

All vertices have the same mass. A compliance is scaled by vertex mass over squared substep, so it
has no unit.
"""

from __future__ import annotations

import math

from numba import njit

from emd_cloth_sim.mesh import IndexArray
from emd_core.frames import FloatArray


@njit(cache=True)
def hold_lengths(
    position: FloatArray, pairs: IndexArray, lengths: FloatArray, compliance: float
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
    position: FloatArray, corners: IndexArray, length: float, compliance: float
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
def limit_sharpness(position: FloatArray, pairs: IndexArray, shortest: FloatArray) -> None:
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
def resist_bending(position: FloatArray, triples: IndexArray, compliance: float) -> None:
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
    held: IndexArray,
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
