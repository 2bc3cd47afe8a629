"""The search for vertices and triangles that may touch."""

from __future__ import annotations

import math

from numba import njit

from emd_cloth_sim.broad_phase import Candidates, Cells, fill_boxes, sort_into_cells
from emd_cloth_sim.closest_points import closest_on_triangle, height_over_triangle
from emd_cloth_sim.mesh import IndexArray
from emd_core.frames import FloatArray


@njit(cache=True)
def find_candidates(
    position: FloatArray,
    triangles: IndexArray,
    reach: float,
    thickness: float,
    radius: float,
    cells: Cells,
    candidates: Candidates,
) -> int:
    """List the pairs of vertex and triangle closer than `reach`; -1 if the lists are too short.

    `radius` bounds the distance of a triangle's corners from its centre.
    """
    centres, order, first, boxes = cells.points, cells.order, cells.first, cells.boxes
    for t in range(triangles.shape[0]):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        for k in range(3):
            centres[t, k] = (position[a, k] + position[b, k] + position[c, k]) / 3.0
    low, cell, count = sort_into_cells(cells, reach + radius)
    fill_boxes(position, triangles, reach, cells)
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


@njit(cache=True, inline="always")
def _add_if_near(
    position: FloatArray,
    triangles: IndexArray,
    v: int,
    t: int,
    reach: float,
    thickness: float,
    candidates: Candidates,
    found: int,
) -> int:
    a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    if v == a or v == b or v == c:
        return found
    height = height_over_triangle(position, v, a, b, c)
    if abs(height) > reach:
        return found
    wa, wb, wc = closest_on_triangle(
        position[v, 0], position[v, 1], position[v, 2], position, a, b, c
    )
    square = 0.0
    for k in range(3):
        gap = position[v, k] - wa * position[a, k] - wb * position[b, k] - wc * position[c, k]
        square += gap * gap
    if square > reach * reach:
        return found
    vertex, triangle = candidates.one, candidates.other
    if found >= vertex.shape[0]:
        return -1
    vertex[found] = v
    triangle[found] = t
    candidates.side[found] = 1.0 if height >= 0.0 else -1.0
    distance = math.sqrt(square)
    candidates.wake[found] = distance - thickness if distance > thickness else -1.0
    return found + 1


@njit(cache=True)
def remember_sides(
    position: FloatArray,
    triangles: IndexArray,
    candidates: Candidates,
    count: int,
    kept: Candidates,
) -> int:
    """Note the pairs whose vertex is on the wrong side just now; returns how many.

    A new search would take the wrong side for the right one.
    """
    vertex, triangle, side = candidates.one, candidates.other, candidates.side
    found = 0
    for n in range(count):
        if candidates.wake[n] >= 0.0 or found == kept.one.shape[0]:
            continue
        t = triangle[n]
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        if side[n] * height_over_triangle(position, vertex[n], a, b, c) >= 0.0:
            continue
        v = vertex[n]
        wa, wb, wc = closest_on_triangle(
            position[v, 0], position[v, 1], position[v, 2], position, a, b, c
        )
        if wa > 0.0 and wb > 0.0 and wc > 0.0:
            kept.one[found] = v
            kept.other[found] = t
            kept.side[found] = side[n]
            found += 1
    return found


@njit(cache=True)
def restore_sides(candidates: Candidates, count: int, kept: Candidates, kept_count: int) -> None:
    """Give pairs noted by `remember_sides` their side back after a new search."""
    for m in range(kept_count):
        for n in range(count):
            if candidates.one[n] == kept.one[m] and candidates.other[n] == kept.other[m]:
                candidates.side[n] = kept.side[m]
                candidates.wake[n] = -1.0
