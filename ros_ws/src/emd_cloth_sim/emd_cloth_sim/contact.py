"""Contact of the cloth with itself and with the desk, with Coulomb friction.

Self-contact keeps every vertex one thickness away from every triangle it does not belong to
(Bridson et al., "Robust Treatment of Collisions, Contact and Friction for Cloth Animation", 2002,
the vertex-triangle half). So the thickness is free of the mesh spacing. Which pairs can touch is
searched only when the cloth has moved by a margin; between searches each pair sleeps until the
cloth could have moved far enough to close its gap.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from emd_core.frames import FloatArray


@njit(cache=True, inline="always")
def _closest_on_triangle(
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
def _height_over_triangle(position: FloatArray, v: int, a: int, b: int, c: int) -> float:
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


@njit(cache=True)
def sort_into_cells(points: FloatArray, cell: float, broad: tuple) -> tuple:
    """Sort points into a dense grid of cells at least `cell` wide (counting sort).

    `broad` is (points (N, 3), cell of each point (N,), points by cell (N,), first point of each
    cell (C + 1,)). Returns the lowest corner, the width and the counts of cells.
    """
    _, cell_of, order, first = broad
    low = np.empty(3)
    count = np.empty(3, dtype=np.int64)
    for k in range(3):
        low[k] = points[:, k].min()
    while True:
        total = 1
        for k in range(3):
            count[k] = int((points[:, k].max() - low[k]) / cell) + 1
            total *= count[k]
        if total < first.shape[0]:
            break
        cell *= 1.3
    first[: total + 1] = 0
    for n in range(points.shape[0]):
        i = int((points[n, 0] - low[0]) / cell)
        j = int((points[n, 1] - low[1]) / cell)
        k = int((points[n, 2] - low[2]) / cell)
        cell_of[n] = (i * count[1] + j) * count[2] + k
        first[cell_of[n] + 1] += 1
    for c in range(total):
        first[c + 1] += first[c]
    for n in range(points.shape[0] - 1, -1, -1):
        c = cell_of[n] + 1
        first[c] -= 1
        order[first[c]] = n
    # After the backward fill `first[c + 1]` is the start of cell c; shift back by one cell.
    for c in range(total):
        first[c] = first[c + 1]
    first[total] = points.shape[0]
    return low, cell, count


@njit(cache=True)
def find_candidates(
    position: FloatArray,
    triangles: np.ndarray,
    reach: float,
    thickness: float,
    radius: float,
    broad: tuple,
    boxes: FloatArray,
    candidates: tuple,
) -> int:
    """List the pairs of vertex and triangle closer than `reach`; -1 if the lists are too short.

    `radius` bounds the distance of a triangle's corners from its centre; `boxes` (T, 6)
    is working memory. `candidates` is (vertex, triangle, side of the triangle, way at which the
    pair wakes).
    """
    centres, _, order, first = broad
    for t in range(triangles.shape[0]):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        for k in range(3):
            centres[t, k] = (position[a, k] + position[b, k] + position[c, k]) / 3.0
    low, cell, count = sort_into_cells(centres, reach + radius, broad)
    _fill_boxes(position, triangles, order, reach, boxes)
    found = 0
    for v in range(position.shape[0]):
        x, y, z = position[v, 0], position[v, 1], position[v, 2]
        i = int(math.floor((x - low[0]) / cell))
        j = int(math.floor((y - low[1]) / cell))
        k = int(math.floor((z - low[2]) / cell))
        k_low, k_high = max(k - 1, 0), min(k + 1, count[2] - 1)
        if k_low > k_high:
            continue
        for ci in range(max(i - 1, 0), min(i + 2, count[0])):
            for cj in range(max(j - 1, 0), min(j + 2, count[1])):
                row = (ci * count[1] + cj) * count[2]
                for n in range(first[row + k_low], first[row + k_high + 1]):
                    if (
                        x < boxes[n, 0]
                        or x > boxes[n, 1]
                        or y < boxes[n, 2]
                        or y > boxes[n, 3]
                        or z < boxes[n, 4]
                        or z > boxes[n, 5]
                    ):
                        continue
                    found = _add_if_near(
                        position, triangles, v, order[n], reach, thickness, candidates, found
                    )
                    if found < 0:
                        return -1
    return found


@njit(cache=True)
def _fill_boxes(
    position: FloatArray, triangles: np.ndarray, order: np.ndarray, pad: float, boxes: FloatArray
) -> None:
    """Bounding boxes of the triangles, grown by `pad`, in the order of their cells."""
    for n in range(triangles.shape[0]):
        t = order[n]
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        for k in range(3):
            u, v, w = position[a, k], position[b, k], position[c, k]
            boxes[n, 2 * k] = min(u, v, w) - pad
            boxes[n, 2 * k + 1] = max(u, v, w) + pad


@njit(cache=True, inline="always")
def _add_if_near(
    position: FloatArray,
    triangles: np.ndarray,
    v: int,
    t: int,
    reach: float,
    thickness: float,
    candidates: tuple,
    found: int,
) -> int:
    a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    if v == a or v == b or v == c:
        return found
    height = _height_over_triangle(position, v, a, b, c)
    if abs(height) > reach:
        return found
    wa, wb, wc = _closest_on_triangle(
        position[v, 0], position[v, 1], position[v, 2], position, a, b, c
    )
    square = 0.0
    for k in range(3):
        gap = position[v, k] - wa * position[a, k] - wb * position[b, k] - wc * position[c, k]
        square += gap * gap
    if square > reach * reach:
        return found
    vertex, triangle, side, wake = candidates
    if found >= vertex.shape[0]:
        return -1
    vertex[found] = v
    triangle[found] = t
    side[found] = 1.0 if height >= 0.0 else -1.0
    distance = math.sqrt(square)
    wake[found] = distance - thickness if distance > thickness else -1.0
    return found + 1


@njit(cache=True)
def remember_sides(
    position: FloatArray, triangles: np.ndarray, candidates: tuple, count: int, kept: tuple
) -> int:
    """Note the pairs whose vertex is on the wrong side just now; returns how many.

    A new search would take the wrong side for the right one. `kept` is (vertex, triangle, side).
    """
    vertex, triangle, side, wake = candidates
    kept_vertex, kept_triangle, kept_side = kept
    found = 0
    for n in range(count):
        if wake[n] >= 0.0 or found == kept_vertex.shape[0]:
            continue
        t = triangle[n]
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        if side[n] * _height_over_triangle(position, vertex[n], a, b, c) >= 0.0:
            continue
        v = vertex[n]
        wa, wb, wc = _closest_on_triangle(
            position[v, 0], position[v, 1], position[v, 2], position, a, b, c
        )
        if wa > 0.0 and wb > 0.0 and wc > 0.0:
            kept_vertex[found] = v
            kept_triangle[found] = t
            kept_side[found] = side[n]
            found += 1
    return found


@njit(cache=True)
def restore_sides(candidates: tuple, count: int, kept: tuple, kept_count: int) -> None:
    """Give pairs noted by `remember_sides` their side back after a new search."""
    vertex, triangle, side, wake = candidates
    for m in range(kept_count):
        for n in range(count):
            if vertex[n] == kept[0][m] and triangle[n] == kept[1][m]:
                side[n] = kept[2][m]
                wake[n] = -1.0


@njit(cache=True)
def collide_with_self(
    position: FloatArray,
    previous: FloatArray,
    triangles: np.ndarray,
    candidates: tuple,
    count: int,
    travelled: float,
    thickness: float,
    friction: float,
) -> None:
    """Push vertices and triangles that are closer than `thickness` apart, with friction.

    A pair in contact (its wake is -1) remembers on which side of the triangle its vertex was, so
    that a vertex that came through is pushed back; beside the triangle it may change sides.
    """
    vertex, triangle, side, wake = candidates
    for n in range(count):
        if travelled < wake[n]:
            continue
        v, t = vertex[n], triangle[n]
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        height = _height_over_triangle(position, v, a, b, c)
        if wake[n] >= 0.0:
            # It slept, so it has not touched since: whatever side it is on now is right.
            side[n] = 1.0 if height >= 0.0 else -1.0
        height *= side[n]
        if height >= thickness:
            wake[n] = travelled + height - thickness
            continue
        wa, wb, wc = _closest_on_triangle(
            position[v, 0], position[v, 1], position[v, 2], position, a, b, c
        )
        x = position[v, 0] - wa * position[a, 0] - wb * position[b, 0] - wc * position[c, 0]
        y = position[v, 1] - wa * position[a, 1] - wb * position[b, 1] - wc * position[c, 1]
        z = position[v, 2] - wa * position[a, 2] - wb * position[b, 2] - wc * position[c, 2]
        distance = math.sqrt(x * x + y * y + z * z)
        if wa > 0.0 and wb > 0.0 and wc > 0.0:
            gap = height
            sign = 1.0 if height > 0.0 else -1.0
        else:
            gap = distance
            sign = 1.0
            if height < 0.0:
                side[n] = -side[n]
        if gap >= thickness:
            wake[n] = travelled + gap - thickness
            continue
        wake[n] = -1.0
        if distance < 1e-9:
            continue
        sign /= distance
        _push_apart(
            position,
            previous,
            (v, a, b, c),
            (wa, wb, wc),
            (x * sign, y * sign, z * sign),
            min(thickness - gap, thickness),
            friction,
        )


@njit(cache=True, inline="always")
def _push_apart(
    position: FloatArray,
    previous: FloatArray,
    corners: tuple[int, int, int, int],
    weights: tuple[float, float, float],
    normal: tuple[float, float, float],
    depth: float,
    friction: float,
) -> None:
    """Move a vertex and a triangle of equal masses apart by `depth`, and brake their sliding."""
    v, a, b, c = corners
    wa, wb, wc = weights
    nx, ny, nz = normal
    share = 1.0 / (1.0 + wa * wa + wb * wb + wc * wc)
    sx = _relative_way(position, previous, v, a, b, c, wa, wb, wc, 0)
    sy = _relative_way(position, previous, v, a, b, c, wa, wb, wc, 1)
    sz = _relative_way(position, previous, v, a, b, c, wa, wb, wc, 2)
    along = sx * nx + sy * ny + sz * nz
    sx -= along * nx
    sy -= along * ny
    sz -= along * nz
    slide = math.sqrt(sx * sx + sy * sy + sz * sz)
    brake = 1.0
    if slide > friction * depth:
        brake = friction * depth / slide
    mx = share * (depth * nx - brake * sx)
    my = share * (depth * ny - brake * sy)
    mz = share * (depth * nz - brake * sz)
    position[v, 0] += mx
    position[v, 1] += my
    position[v, 2] += mz
    position[a, 0] -= wa * mx
    position[a, 1] -= wa * my
    position[a, 2] -= wa * mz
    position[b, 0] -= wb * mx
    position[b, 1] -= wb * my
    position[b, 2] -= wb * mz
    position[c, 0] -= wc * mx
    position[c, 1] -= wc * my
    position[c, 2] -= wc * mz


@njit(cache=True, inline="always")
def _relative_way(
    position: FloatArray,
    previous: FloatArray,
    v: int,
    a: int,
    b: int,
    c: int,
    wa: float,
    wb: float,
    wc: float,
    k: int,
) -> float:
    """Way of vertex v in this substep against the triangle's point below it, along axis k."""
    return (
        position[v, k]
        - previous[v, k]
        - wa * (position[a, k] - previous[a, k])
        - wb * (position[b, k] - previous[b, k])
        - wc * (position[c, k] - previous[c, k])
    )


@njit(cache=True)
def collide_with_desk(
    position: FloatArray, previous: FloatArray, height: float, friction: float
) -> None:
    """Keep vertices at least `height` over the desk (z = 0) and brake their sliding on it."""
    for v in range(position.shape[0]):
        depth = height - position[v, 2]
        if depth <= 0.0:
            continue
        position[v, 2] = height
        x = position[v, 0] - previous[v, 0]
        y = position[v, 1] - previous[v, 1]
        slide = math.sqrt(x * x + y * y)
        brake = 1.0
        if slide > friction * depth:
            brake = friction * depth / slide
        position[v, 0] -= brake * x
        position[v, 1] -= brake * y
