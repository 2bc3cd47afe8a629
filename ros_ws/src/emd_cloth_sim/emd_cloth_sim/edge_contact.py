"""Edge-edge contact: keeps two layers from slipping through each other between their vertices.

Vertex-triangle contact alone keeps layers apart but leaves holes where only edges meet. This half
(Bridson et al., 2002) closes them. It acts at a fraction of the thickness, so that nearly all
pairs sleep while the other half does its work.
"""

from __future__ import annotations

import math

from numba import njit

from emd_cloth_sim.broad_phase import Candidates, Cells, fill_boxes, sort_into_cells
from emd_cloth_sim.closest_points import closest_on_segments, height_over_edge
from emd_cloth_sim.mesh import IndexArray
from emd_core.frames import FloatArray


@njit(cache=True)
def find_edge_candidates(
    position: FloatArray,
    edges: IndexArray,
    reach: float,
    thickness: float,
    longest: float,
    cells: Cells,
    candidates: Candidates,
) -> int:
    """List the pairs of edges closer than `reach`; -1 if the lists are too short.

    `longest` bounds the length of an edge.
    """
    middles, cell_of, boxes = cells.points, cells.cell_of, cells.boxes
    order, first = cells.order, cells.first
    for e in range(edges.shape[0]):
        p, q = edges[e, 0], edges[e, 1]
        for k in range(3):
            middles[e, k] = 0.5 * (position[p, k] + position[q, k])
    _, _, count = sort_into_cells(cells, reach + longest)
    fill_boxes(position, edges, 0.5 * reach, cells)
    found = 0
    for m in range(edges.shape[0]):
        e = order[m]
        here = cell_of[e]
        k = here % count[2]
        j = (here // count[2]) % count[1]
        i = here // (count[1] * count[2])
        k_low, k_high = max(k - 1, 0), min(k + 1, count[2] - 1)
        x0, x1, y0, y1, z0, z1 = boxes[m]
        for ci in range(i, min(i + 2, count[0])):
            for cj in range(max(j - 1, 0), min(j + 2, count[1])):
                row = (ci * count[1] + cj) * count[2]
                for n in range(max(first[row + k_low], m + 1), first[row + k_high + 1]):
                    if (
                        x0 > boxes[n, 1]
                        or boxes[n, 0] > x1
                        or y0 > boxes[n, 3]
                        or boxes[n, 2] > y1
                        or z0 > boxes[n, 5]
                        or boxes[n, 4] > z1
                    ):
                        continue
                    found = _add_if_near(
                        position, edges, e, order[n], reach, thickness, candidates, found
                    )
                    if found < 0:
                        return -1
    return found


@njit(cache=True, inline="always")
def _add_if_near(
    position: FloatArray,
    edges: IndexArray,
    e: int,
    g: int,
    reach: float,
    thickness: float,
    candidates: Candidates,
    found: int,
) -> int:
    p, q, u, w = edges[e, 0], edges[e, 1], edges[g, 0], edges[g, 1]
    if p == u or p == w or q == u or q == w:
        return found
    _, _, x, y, z, _ = closest_on_segments(position, p, q, u, w)
    distance = math.sqrt(x * x + y * y + z * z)
    if distance > reach:
        return found
    one, other, side, wake = candidates
    if found >= one.shape[0]:
        return -1
    one[found] = e
    other[found] = g
    height = height_over_edge(position, p, q, u, w)[0]
    side[found] = 1.0 if height >= 0.0 else -1.0
    wake[found] = distance - thickness if distance > thickness else -1.0
    return found + 1


@njit(cache=True)
def collide_edges(
    position: FloatArray,
    edges: IndexArray,
    candidates: Candidates,
    count: int,
    travelled: float,
    thickness: float,
) -> None:
    """Push crossing sides that are closer than `thickness` apart along their common normal."""
    one, other, side, wake = candidates
    longest_push = 0.3 * thickness
    for n in range(count):
        if travelled < wake[n]:
            continue
        p, q = edges[one[n], 0], edges[one[n], 1]
        u, w = edges[other[n], 0], edges[other[n], 1]
        height, nx, ny, nz = height_over_edge(position, p, q, u, w)
        slept = wake[n] >= 0.0
        if slept:
            side[n] = 1.0 if height >= 0.0 else -1.0
        height *= side[n]
        if height >= thickness:
            wake[n] = travelled + height - thickness
            continue
        s, t, x, y, z, sine = closest_on_segments(position, p, q, u, w)
        if s <= 0.0 or s >= 1.0 or t <= 0.0 or t >= 1.0 or sine < 1e-3:
            distance = math.sqrt(x * x + y * y + z * z)
            if distance >= thickness:
                wake[n] = travelled + distance - thickness
            else:
                wake[n] = -1.0
                if height < 0.0:
                    side[n] = -side[n]
            continue
        wake[n] = -1.0
        share = (1.0 - s) ** 2 + s * s + (1.0 - t) ** 2 + t * t
        push = side[n] * min(thickness - height, longest_push) / share
        for k in range(3):
            normal = nx if k == 0 else (ny if k == 1 else nz)
            position[p, k] += push * (1.0 - s) * normal
            position[q, k] += push * s * normal
            position[u, k] -= push * (1.0 - t) * normal
            position[w, k] -= push * t * normal
