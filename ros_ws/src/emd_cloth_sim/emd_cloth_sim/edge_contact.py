"""Edge-edge contact, where vertex-triangle contact alone has let edges pass.

Vertices that keep away from triangles leave holes where two sharp folds meet edge to edge. Such
pairs are few, so they are not searched for: whenever a crossing has been undone, its edges are
watched for a while and pushed apart (Bridson et al., 2002). Watched for ever, the edges of a pile
would lock each other.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from emd_cloth_sim.closest_points import NEARLY_PARALLEL, closest_on_segments, height_over_edge
from emd_cloth_sim.mesh import IndexArray
from emd_cloth_sim.planes import FAST, Single

ZERO, ONE = np.float32(0.0), np.float32(1.0)
LONGEST_PUSH = np.float32(0.3)
# Distance at which a pair is no longer watched, in thicknesses of edges.
PARTED = np.float32(3.0)
# Looks for crossings for which a pair is watched.
OLD = 4


class EdgePairs(NamedTuple):
    """Edges that are watched.

    Attributes:
        ends: Vertices of the one and of the other edge, shape (M, 4).
        side: On which side of the other edge the one is, 1 or -1, shape (M,).
        age: Looks for crossings since the pair's last one, shape (M,).
        length: How many pairs there are, shape (1,).
    """

    ends: IndexArray
    side: NDArray[np.float32]
    age: NDArray[np.int32]
    length: NDArray[np.int64]


def allocate_edge_pairs(size: int) -> EdgePairs:
    """Make an empty list with room for `size` pairs."""
    return EdgePairs(
        np.empty((size, 4), np.int32),
        np.empty(size, np.float32),
        np.empty(size, np.int32),
        np.zeros(1, np.int64),
    )


@njit(**FAST)
def watch_edges(
    position: NDArray[np.float32], crossings: IndexArray, found: int, pairs: EdgePairs
) -> None:
    """Watch the edges of crossings (p, q through a, b, c) from a state without crossings."""
    for n in range(found):
        p, q = crossings[n, 0], crossings[n, 1]
        for k in range(3):
            _watch(position, p, q, crossings[n, 2 + k], crossings[n, 2 + (k + 1) % 3], pairs)


@njit(**FAST)
def _watch(
    position: NDArray[np.float32], p: int, q: int, u: int, w: int, pairs: EdgePairs
) -> None:
    ends, side, age, count = pairs
    if p == u or p == w or q == u or q == w or count[0] == ends.shape[0]:
        return
    p, q, u, w = min(p, q), max(p, q), min(u, w), max(u, w)
    for n in range(count[0]):
        same = ends[n, 0] == p and ends[n, 1] == q and ends[n, 2] == u and ends[n, 3] == w
        swapped = ends[n, 0] == u and ends[n, 1] == w and ends[n, 2] == p and ends[n, 3] == q
        if same or swapped:
            age[n] = 0
            return
    height = height_over_edge(position, p, q, u, w)[0]
    n = count[0]
    ends[n, 0], ends[n, 1], ends[n, 2], ends[n, 3] = p, q, u, w
    side[n] = ONE if height >= ZERO else -ONE
    age[n] = 0
    count[0] += 1


@njit(**FAST)
def forget_parted(position: NDArray[np.float32], pairs: EdgePairs, thickness: Single) -> None:
    """Drop the pairs that are far from each other, and those that have not crossed for long."""
    ends, side, age, count = pairs
    kept = 0
    for n in range(count[0]):
        _, _, x, y, z, _ = closest_on_segments(
            position, ends[n, 0], ends[n, 1], ends[n, 2], ends[n, 3]
        )
        age[n] += 1
        if age[n] < OLD and math.sqrt(x * x + y * y + z * z) < PARTED * thickness:
            for k in range(4):
                ends[kept, k] = ends[n, k]
            side[kept], age[kept] = side[n], age[n]
            kept += 1
    count[0] = kept


@njit(**FAST)
def collide_edges(position: NDArray[np.float32], pairs: EdgePairs, thickness: Single) -> None:
    """Push watched edges that are closer than `thickness` apart along their common normal."""
    ends, side, _, count = pairs
    for n in range(count[0]):
        p, q, u, w = ends[n, 0], ends[n, 1], ends[n, 2], ends[n, 3]
        height, nx, ny, nz = height_over_edge(position, p, q, u, w)
        height *= side[n]
        if height >= thickness:
            continue
        s, t, _, _, _, sine = closest_on_segments(position, p, q, u, w)
        if s <= ZERO or s >= ONE or t <= ZERO or t >= ONE or sine < NEARLY_PARALLEL:
            # Past each other's ends they may change sides.
            if height < ZERO:
                side[n] = -side[n]
            continue
        share = (ONE - s) * (ONE - s) + s * s + (ONE - t) * (ONE - t) + t * t
        push = side[n] * min(thickness - height, LONGEST_PUSH * thickness) / share
        for k in range(3):
            way = push * (nx if k == 0 else (ny if k == 1 else nz))
            position[p, k] += (ONE - s) * way
            position[q, k] += s * way
            position[u, k] -= (ONE - t) * way
            position[w, k] -= t * way
