"""Crossings of the cloth with itself: finding them.

A crossing is an edge of a triangle, diagonals included, that passes through another triangle
without a common vertex. The search compares boxes of patches, then of cells, then triangles with
each other's planes; only what is left needs the exact test.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from emd_cloth_sim.broad_phase import (
    PLACES,
    Patches,
    box_of,
    fill_boxes,
    fill_normals,
    lowest_bit,
    mark_overlaps,
    pair_patches,
)
from emd_cloth_sim.mesh import IndexArray
from emd_cloth_sim.planes import FAST, Single

Positions = NDArray[np.floating[Any]]
# All normals within a right angle of one direction: no crossing.
FACING = np.float32(0.0)
EVERYWHERE = np.float32(2.0)
ZERO = np.float32(0.0)
# Ends of an edge nearer to a triangle's plane only touch it, metres: that is what single precision
# can tell.
TOUCHING = np.float32(1e-6)
PAD = np.float32(1e-7)


@njit(**FAST)
def find_crossings(
    position: NDArray[np.float32],
    triangles: IndexArray,
    rows: int,
    columns: int,
    patches: Patches,
    facing: Single,
    found: IndexArray,
) -> int:
    """List crossings as the five vertices of edge and triangle, shape (M, 5); returns how many.

    Neighbouring patches that face the same way, see `pair_patches`, are taken to be free of them.

    The count goes on when the list is full.
    """
    fill_boxes(position, rows, columns, PAD, patches)
    fill_normals(position, triangles, patches)
    boxes = patches.boxes
    total = 0
    for m in range(pair_patches(patches, facing, ZERO)):
        p, q = patches.pairs[m]
        for n in range(p * PLACES, (p + 1) * PLACES):
            one = patches.cells[n]
            if one < 0:
                continue
            x0, x1, y0, y1, z0, z1 = box_of(boxes, n)
            marks = mark_overlaps(boxes, q, x0, x1, y0, y1, z0, z1)
            while marks != 0:
                o = q * PLACES + lowest_bit(marks)
                marks &= marks - 1
                other = patches.cells[o]
                if o > n and other >= 0:
                    total = _cross_cells(
                        position, triangles, patches.normals, one, other, found, total
                    )
    return total


@njit(**FAST)
def _cross_cells(
    position: NDArray[np.float32],
    triangles: IndexArray,
    normals: NDArray[np.float32],
    one: int,
    other: int,
    found: IndexArray,
    total: int,
) -> int:
    """Add the crossings between two cells' triangles."""
    for t in range(2 * one, 2 * one + 2):
        for u in range(2 * other, 2 * other + 2):
            if _apart(position, triangles, normals, t, u):
                continue
            if _apart(position, triangles, normals, u, t):
                continue
            for k in range(3):
                total = _cross(position, triangles, t, k, u, found, total)
                total = _cross(position, triangles, u, k, t, found, total)
    return total


@njit(inline="always")
def _apart(
    position: NDArray[np.float32],
    triangles: IndexArray,
    normals: NDArray[np.float32],
    t: int,
    u: int,
) -> bool:
    """Whether triangle u, but for common vertices, is on one side of triangle t's plane."""
    a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    x, y, z = normals[t, 0], normals[t, 1], normals[t, 2]
    least = TOUCHING * math.sqrt(x * x + y * y + z * z)
    above = below = 0
    for k in range(3):
        v = triangles[u, k]
        height = (
            x * (position[v, 0] - position[a, 0])
            + y * (position[v, 1] - position[a, 1])
            + z * (position[v, 2] - position[a, 2])
        )
        own = (v == a) | (v == b) | (v == c)
        above += (height > least) & (not own)
        below += (height < -least) & (not own)
    return above == 0 or below == 0


@njit(inline="always")
def _cross(
    position: NDArray[np.float32],
    triangles: IndexArray,
    t: int,
    k: int,
    u: int,
    found: IndexArray,
    total: int,
) -> int:
    """Add the crossing of side k of triangle t with triangle u, if they do cross."""
    p, q = triangles[t, k], triangles[t, (k + 1) % 3]
    a, b, c = triangles[u, 0], triangles[u, 1], triangles[u, 2]
    if not crosses(position, p, q, a, b, c):
        return total
    if total < found.shape[0]:
        found[total, 0], found[total, 1] = p, q
        found[total, 2], found[total, 3], found[total, 4] = a, b, c
    return total + 1


@njit(**FAST)
def crosses(position: Positions, p: int, q: int, a: int, b: int, c: int) -> bool:
    """Whether segment p-q passes through triangle a, b, c (signed volumes of tetrahedra)."""
    if p == a or p == b or p == c or q == a or q == b or q == c:
        return False
    one, other = _volume(position, a, b, c, p), _volume(position, a, b, c, q)
    if one * other >= 0:
        return False
    x, y, z = _normal(position, a, b, c)
    least = TOUCHING * math.sqrt(x * x + y * y + z * z)
    if abs(one) < least or abs(other) < least:
        return False
    first = _volume(position, p, q, a, b)
    second = _volume(position, p, q, b, c)
    third = _volume(position, p, q, c, a)
    return (first > 0 and second > 0 and third > 0) or (first < 0 and second < 0 and third < 0)


@njit(inline="always")
def _volume(position: Positions, a: int, b: int, c: int, d: int) -> Single:
    """Six times the signed volume of the tetrahedron a, b, c, d."""
    x, y, z = _normal(position, a, b, c)
    return (
        x * (position[d, 0] - position[a, 0])
        + y * (position[d, 1] - position[a, 1])
        + z * (position[d, 2] - position[a, 2])
    )


@njit(inline="always")
def _normal(position: Positions, a: int, b: int, c: int) -> tuple[Single, Single, Single]:
    """Normal of triangle a, b, c, as long as twice its area."""
    u0 = position[b, 0] - position[a, 0]
    u1 = position[b, 1] - position[a, 1]
    u2 = position[b, 2] - position[a, 2]
    v0 = position[c, 0] - position[a, 0]
    v1 = position[c, 1] - position[a, 1]
    v2 = position[c, 2] - position[a, 2]
    return u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
