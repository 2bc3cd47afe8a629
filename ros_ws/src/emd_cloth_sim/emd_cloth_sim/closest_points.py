"""Distances between vertices, triangles and edges of the mesh, for the contact kernels."""

from __future__ import annotations

import math

from numba import njit

from emd_core.frames import FloatArray


@njit(cache=True, inline="always")
def closest_on_triangle(
    px: float, py: float, pz: float, position: FloatArray, a: int, b: int, c: int
) -> tuple[float, float, float]:
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
    if d1 <= 0.0 and d2 <= 0.0:
        return 1.0, 0.0, 0.0
    bpx, bpy, bpz = px - position[b, 0], py - position[b, 1], pz - position[b, 2]
    d3 = abx * bpx + aby * bpy + abz * bpz
    d4 = acx * bpx + acy * bpy + acz * bpz
    if d3 >= 0.0 and d4 <= d3:
        return 0.0, 1.0, 0.0
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        t = d1 / (d1 - d3)
        return 1.0 - t, t, 0.0
    cpx, cpy, cpz = px - position[c, 0], py - position[c, 1], pz - position[c, 2]
    d5 = abx * cpx + aby * cpy + abz * cpz
    d6 = acx * cpx + acy * cpy + acz * cpz
    if d6 >= 0.0 and d5 <= d6:
        return 0.0, 0.0, 1.0
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        t = d2 / (d2 - d6)
        return 1.0 - t, 0.0, t
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return 0.0, 1.0 - t, t
    total = va + vb + vc
    if total <= 0.0:
        return 1.0, 0.0, 0.0
    return va / total, vb / total, vc / total


@njit(cache=True, inline="always")
def height_over_triangle(position: FloatArray, v: int, a: int, b: int, c: int) -> float:
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
    if length < 1e-14:
        return 0.0
    dot = (
        nx * (position[v, 0] - position[a, 0])
        + ny * (position[v, 1] - position[a, 1])
        + nz * (position[v, 2] - position[a, 2])
    )
    return dot / length


@njit(cache=True, inline="always")
def closest_on_segments(
    position: FloatArray, p: int, q: int, u: int, w: int
) -> tuple[float, float, float, float, float, float]:
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
    s = 0.5
    if determinant > 1e-3 * a * e:
        s = min(max((b * f - c * e) / determinant, 0.0), 1.0)
    t = (b * s + f) / e
    if t < 0.0:
        t = 0.0
        s = min(max(-c / a, 0.0), 1.0)
    elif t > 1.0:
        t = 1.0
        s = min(max((b - c) / a, 0.0), 1.0)
    return (
        s,
        t,
        rx + s * d1x - t * d2x,
        ry + s * d1y - t * d2y,
        rz + s * d1z - t * d2z,
        determinant / (a * e),
    )


@njit(cache=True, inline="always")
def height_over_edge(
    position: FloatArray, p: int, q: int, u: int, w: int
) -> tuple[float, float, float, float]:
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
    if length < 1e-14:
        return 0.0, 0.0, 0.0, 0.0
    nx /= length
    ny /= length
    nz /= length
    height = (
        nx * (position[p, 0] - position[u, 0])
        + ny * (position[p, 1] - position[u, 1])
        + nz * (position[p, 2] - position[u, 2])
    )
    return height, nx, ny, nz
