"""The search for vertices and triangles that may touch."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from emd_cloth_sim.broad_phase import (
    PLACES,
    Candidates,
    Patches,
    fill_boxes,
    fill_normals,
    lowest_bit,
    mark_overlaps,
    pair_patches,
)
from emd_cloth_sim.closest_points import height_over_triangle
from emd_cloth_sim.mesh import IndexArray
from emd_cloth_sim.planes import FAST

# Neighbours whose normals are within 60 degrees of one direction do not touch each other.
FACING = np.float32(0.5)
ZERO, HALF, ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)


@njit(**FAST)
def find_candidates(
    position: NDArray[np.float32],
    triangles: IndexArray,
    sheet: tuple[int, int, np.float32, np.float32, np.float32],
    reach: np.float32,
    thickness: np.float32,
    patches: Patches,
    candidates: Candidates,
) -> int:
    """List the pairs of vertex and triangle closer than `reach`; -1 if the lists are too short.

    `sheet` holds the counts of vertices along x and y, their spacings, and how far apart on the
    flat sheet a vertex and a cell must be to collide, metres.
    """
    rows, columns = sheet[0], sheet[1]
    fill_boxes(position, rows, columns, HALF * reach, patches)
    fill_normals(position, triangles, patches)
    found = 0
    for m in range(pair_patches(patches, FACING)):
        p, q = patches.pairs[m]
        found = _find_between(
            position, triangles, sheet, reach, thickness, p, q, patches, candidates, found
        )
        if found >= 0 and p != q:
            found = _find_between(
                position, triangles, sheet, reach, thickness, q, p, patches, candidates, found
            )
        if found < 0:
            return -1
    return found


@njit(**FAST)
def _find_between(
    position: NDArray[np.float32],
    triangles: IndexArray,
    sheet: tuple[int, int, np.float32, np.float32, np.float32],
    reach: np.float32,
    thickness: np.float32,
    p: int,
    q: int,
    patches: Patches,
    candidates: Candidates,
    found: int,
) -> int:
    """Add the pairs of a vertex of patch p and a triangle of patch q."""
    boxes, places = patches.boxes, patches.places
    apart, pad = sheet[4] * sheet[4], HALF * reach
    for s in range(PLACES):
        v = places[p * PLACES + s]
        if v < 0:
            continue
        x0, x1 = position[v, 0] - pad, position[v, 0] + pad
        y0, y1 = position[v, 1] - pad, position[v, 1] + pad
        z0, z1 = position[v, 2] - pad, position[v, 2] + pad
        marks = mark_overlaps(boxes, q, x0, x1, y0, y1, z0, z1)
        while marks != 0:
            n = q * PLACES + lowest_bit(marks)
            marks &= marks - 1
            cell = patches.cells[n]
            if cell < 0 or _distance_on_sheet(patches, p * PLACES + s, n, sheet) < apart:
                continue
            for t in range(2 * cell, 2 * cell + 2):
                found = _add_if_near(
                    position, triangles, v, t, reach, thickness, candidates, found
                )
                if found < 0:
                    return -1
    return found


@njit(inline="always")
def _distance_on_sheet(
    patches: Patches,
    vertex: int,
    cell: int,
    sheet: tuple[int, int, np.float32, np.float32, np.float32],
) -> np.float32:
    """Square of the distance of a place's vertex and a place's cell on the flat sheet."""
    rows = patches.rows[cell] - patches.rows[vertex]
    columns = patches.columns[cell] - patches.columns[vertex]
    x = sheet[2] * np.float32(max(rows, -rows - 1))
    y = sheet[3] * np.float32(max(columns, -columns - 1))
    return x * x + y * y


@njit(inline="always")
def _add_if_near(
    position: NDArray[np.float32],
    triangles: IndexArray,
    v: int,
    t: int,
    reach: np.float32,
    thickness: np.float32,
    candidates: Candidates,
    found: int,
) -> int:
    a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    height = height_over_triangle(position, v, a, b, c)
    if abs(height) > reach:
        return found
    if found >= candidates.vertex.shape[0]:
        return -1
    candidates.vertex[found] = v
    candidates.triangle[found] = t
    candidates.side[found] = ONE if height >= 0 else -ONE
    # The height is a lower bound of the distance, which is worked out when the pair wakes.
    candidates.wake[found] = max(abs(height) - thickness, ZERO)
    return found + 1
