"""The search for vertices and triangles that may touch."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from emd_cloth_sim.broad_phase import (
    PLACES,
    Patches,
    fill_boxes,
    fill_normals,
    fill_patch,
    gap_between,
    lowest_bit,
    mark_overlaps,
    pair_patches,
)
from emd_cloth_sim.closest_points import height_over_triangle
from emd_cloth_sim.contact_pairs import Candidates, Motion, Segments
from emd_cloth_sim.mesh import IndexArray
from emd_cloth_sim.planes import FAST, Single

# Counts of vertices along x and y, their spacings, and how far apart on the flat sheet a vertex
# and a cell must be to collide, metres.
Sheet = tuple[int, int, Single, Single, Single]

# Neighbours whose normals are within 45 degrees of one direction do not touch each other.
FACING = np.float32(0.7)
# Way that two patches may move before all pairs of patches are listed anew, metres.
PAIR_MARGIN = np.float32(0.010)
NEVER = np.float32(1e9)
ZERO, HALF, ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)


@njit(**FAST)
def list_pairs(
    position: NDArray[np.float32],
    triangles: IndexArray,
    sheet: Sheet,
    reach: Single,
    patches: Patches,
    segments: Segments,
    motion: Motion,
) -> int:
    """List the pairs of patches that may touch before one has moved by half of `PAIR_MARGIN`.

    Each is to be searched when its patches come within `reach` of each other.
    """
    fill_boxes(position, sheet[0], sheet[1], HALF * reach, patches)
    fill_normals(position, triangles, patches)
    for p in range(motion.moved.shape[0]):
        motion.moved[p] = motion.boxed[p] = ZERO
    count = pair_patches(patches, FACING, PAIR_MARGIN)
    for m in range(count):
        gap = gap_between(patches.patch_boxes, patches.pairs[m, 0], patches.pairs[m, 1])
        segments.start[m] = segments.stop[m] = segments.touching[m] = 0
        segments.search[m] = max(gap, ZERO)
        segments.wake[m] = NEVER
        segments.good[m] = -ONE
    return count


@njit(**FAST)
def search_pair(
    position: NDArray[np.float32],
    triangles: IndexArray,
    sheet: Sheet,
    reach: Single,
    thickness: Single,
    m: int,
    patches: Patches,
    motion: Motion,
    candidates: Candidates,
    segments: Segments,
    used: int,
) -> int:
    """Append the candidates of pair m of patches; -1 if the lists are too short.

    They are the pairs of vertex and triangle closer than `reach`. Returns the new length.
    """
    p, q = patches.pairs[m, 0], patches.pairs[m, 1]
    for patch in (p, q):
        if motion.boxed[patch] != motion.moved[patch]:
            fill_patch(position, sheet[0], sheet[1], HALF * reach, patches, patch)
            motion.boxed[patch] = motion.moved[patch]
    so_far = motion.moved[p] + motion.moved[q]
    gap = gap_between(patches.patch_boxes, p, q)
    stop = used
    if gap <= ZERO:
        for turn in range(1 if p == q else 2):
            one, other = (p, q) if turn == 0 else (q, p)
            stop = _find_between(
                position,
                triangles,
                sheet,
                reach,
                thickness,
                one,
                other,
                patches,
                so_far,
                candidates,
                stop,
            )
            if stop < 0:
                return -1
    segments.start[m], segments.stop[m] = used, stop
    segments.search[m] = so_far + max(gap, reach - thickness)
    segments.wake[m] = so_far if stop > used else NEVER
    return stop


@njit(**FAST)
def _find_between(
    position: NDArray[np.float32],
    triangles: IndexArray,
    sheet: Sheet,
    reach: Single,
    thickness: Single,
    p: int,
    q: int,
    patches: Patches,
    so_far: Single,
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
                    position, triangles, v, t, reach, thickness, so_far, candidates, found
                )
                if found < 0:
                    return -1
    return found


@njit(inline="always")
def _distance_on_sheet(
    patches: Patches,
    vertex: int,
    cell: int,
    sheet: Sheet,
) -> Single:
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
    reach: Single,
    thickness: Single,
    so_far: Single,
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
    candidates.wake[found] = so_far + max(abs(height) - thickness, ZERO)
    return found + 1
