"""Distances between vertices, triangles and edges of the mesh, for the contact kernels."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from emd_cloth_sim.planes import Single

Positions = NDArray[np.floating[Any]]
ZERO, HALF, ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)
NEARLY_PARALLEL = np.float32(1e-3)
TINY = np.float32(1e-14)


@njit(inline="always")
def closest_on_triangle(
    px: Single, py: Single, pz: Single, position: Positions, a: int, b: int, c: int
) -> tuple[Single, Single, Single]:
    """Barycentric weights of the point of triangle a, b, c that is closest to p.

    By Voronoi regions (Ericson, "Real-Time Collision Detection", 5.1.5).
    """
    abx, aby, abz = (
        position[b, 0] - position[a, 0],
        position[b, 1] - position[a, 1],
        position[b, 2] - position[a, 2],
    )
    acx, acy, acz = (
        position[c, 0] - position[a, 0],
        position[c, 1] - position[a, 1],
        position[c, 2] - position[a, 2],
    )
    apx, apy, apz = px - position[a, 0], py - position[a, 1], pz - position[a, 2]
    d1 = abx * apx + aby * apy + abz * apz
    d2 = acx * apx + acy * apy + acz * apz
    if d1 <= ZERO and d2 <= ZERO:
        return ONE, ZERO, ZERO
    bpx, bpy, bpz = px - position[b, 0], py - position[b, 1], pz - position[b, 2]
    d3 = abx * bpx + aby * bpy + abz * bpz
    d4 = acx * bpx + acy * bpy + acz * bpz
    if d3 >= ZERO and d4 <= d3:
        return ZERO, ONE, ZERO
    vc = d1 * d4 - d3 * d2
    if vc <= ZERO and d1 >= ZERO and d3 <= ZERO:
        t = d1 / (d1 - d3)
        return ONE - t, t, ZERO
    cpx, cpy, cpz = px - position[c, 0], py - position[c, 1], pz - position[c, 2]
    d5 = abx * cpx + aby * cpy + abz * cpz
    d6 = acx * cpx + acy * cpy + acz * cpz
    if d6 >= ZERO and d5 <= d6:
        return ZERO, ZERO, ONE
    vb = d5 * d2 - d1 * d6
    if vb <= ZERO and d2 >= ZERO and d6 <= ZERO:
        t = d2 / (d2 - d6)
        return ONE - t, ZERO, t
    va = d3 * d6 - d5 * d4
    if va <= ZERO and d4 - d3 >= ZERO and d5 - d6 >= ZERO:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return ZERO, ONE - t, t
    total = va + vb + vc
    if total <= ZERO:
        return ONE, ZERO, ZERO
    return va / total, vb / total, vc / total


@njit(inline="always")
def height_over_triangle(position: Positions, v: int, a: int, b: int, c: int) -> Single:
    """Signed distance of vertex v from the plane of triangle a, b, c; 0 if it has no area."""
    abx, aby, abz = (
        position[b, 0] - position[a, 0],
        position[b, 1] - position[a, 1],
        position[b, 2] - position[a, 2],
    )
    acx, acy, acz = (
        position[c, 0] - position[a, 0],
        position[c, 1] - position[a, 1],
        position[c, 2] - position[a, 2],
    )
    nx, ny, nz = aby * acz - abz * acy, abz * acx - abx * acz, abx * acy - aby * acx
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if length < TINY:
        return ZERO
    dot = (
        nx * (position[v, 0] - position[a, 0])
        + ny * (position[v, 1] - position[a, 1])
        + nz * (position[v, 2] - position[a, 2])
    )
    return dot / length


@njit(inline="always")
def closest_on_segments(
    position: Positions, p: int, q: int, u: int, w: int
) -> tuple[Single, Single, Single, Single, Single, Single]:
    """Parameters of the closest points of segments p-q and u-w, and the vector between them.

    Ericson, "Real-Time Collision Detection", 5.1.9.
    """
    d1x, d1y, d1z = (
        position[q, 0] - position[p, 0],
        position[q, 1] - position[p, 1],
        position[q, 2] - position[p, 2],
    )
    d2x, d2y, d2z = (
        position[w, 0] - position[u, 0],
        position[w, 1] - position[u, 1],
        position[w, 2] - position[u, 2],
    )
    rx, ry, rz = (
        position[p, 0] - position[u, 0],
        position[p, 1] - position[u, 1],
        position[p, 2] - position[u, 2],
    )
    a = d1x * d1x + d1y * d1y + d1z * d1z
    e = d2x * d2x + d2y * d2y + d2z * d2z
    f = d2x * rx + d2y * ry + d2z * rz
    c = d1x * rx + d1y * ry + d1z * rz
    b = d1x * d2x + d1y * d2y + d1z * d2z
    determinant = a * e - b * b
    s = HALF
    if determinant > NEARLY_PARALLEL * a * e:
        s = min(max((b * f - c * e) / determinant, ZERO), ONE)
    t = (b * s + f) / e
    if t < ZERO:
        t = ZERO
        s = min(max(-c / a, ZERO), ONE)
    elif t > ONE:
        t = ONE
        s = min(max((b - c) / a, ZERO), ONE)
    return (
        s,
        t,
        rx + s * d1x - t * d2x,
        ry + s * d1y - t * d2y,
        rz + s * d1z - t * d2z,
        determinant / (a * e),
    )


@njit(inline="always")
def height_over_edge(
    position: Positions, p: int, q: int, u: int, w: int
) -> tuple[Single, Single, Single, Single]:
    """Signed distance of the lines p-q and u-w, and their common unit normal; 0 if parallel."""
    ax, ay, az = (
        position[q, 0] - position[p, 0],
        position[q, 1] - position[p, 1],
        position[q, 2] - position[p, 2],
    )
    bx, by, bz = (
        position[w, 0] - position[u, 0],
        position[w, 1] - position[u, 1],
        position[w, 2] - position[u, 2],
    )
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if length < TINY:
        return ZERO, ZERO, ZERO, ZERO
    nx /= length
    ny /= length
    nz /= length
    height = (
        nx * (position[p, 0] - position[u, 0])
        + ny * (position[p, 1] - position[u, 1])
        + nz * (position[p, 2] - position[u, 2])
    )
    return height, nx, ny, nz
