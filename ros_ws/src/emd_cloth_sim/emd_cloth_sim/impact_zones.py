"""Undoing crossings: what would pass through itself moves on as one piece.

Vertices that take part in a crossing become a zone that keeps the shape it had before and follows
the mean of its vertices' motion (rigid impact zones; Provot, 1997; Bridson et al., 2002, here
without turning). So a tangle is carried along with the cloth around it rather than left behind.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from emd_cloth_sim.broad_phase import Patches
from emd_cloth_sim.crossings import find_crossings
from emd_cloth_sim.edge_contact import EdgePairs, watch_edges
from emd_cloth_sim.mesh import IndexArray
from emd_cloth_sim.planes import FAST, Single

Singles = NDArray[np.float32]
# All normals within a right angle of one direction: no crossing.
FACING = np.float32(0.0)
# Rounds of enlarging zones before the whole cloth is one.
ROUNDS = 20
# How much more a vertex in a rigid grip counts in the mean than a free one.
GRIPPED = 1e8
HIGH = 1e30


class Zones(NamedTuple):
    """Memory for the zones of one repair.

    Attributes:
        leader: Another vertex of the same zone, itself if it leads it, -1 outside, shape (V,).
        weight: Of each leader's zone, shape (V,).
        sums: Weighted way and velocity of each leader's zone, shape (V, 6).
        lowest: Of each leader's zone when it was safe, metres, shape (V,).
        wanted: Position and velocity that each vertex would have without zones, shape (V, 6).
    """

    leader: IndexArray
    weight: NDArray[np.float64]
    sums: NDArray[np.float64]
    lowest: NDArray[np.float64]
    wanted: Singles


def allocate_zones(vertices: int) -> Zones:
    """Make memory for a cloth of so many vertices."""
    return Zones(
        np.empty(vertices, np.int32),
        np.empty(vertices),
        np.empty((vertices, 6)),
        np.empty(vertices),
        np.empty((vertices, 6), np.float32),
    )


@njit(**FAST)
def undo_crossings(
    position: Singles,
    velocity: Singles,
    safe: Singles,
    mobility: NDArray[np.float64],
    triangles: IndexArray,
    rows: int,
    columns: int,
    patches: Patches,
    found: IndexArray,
    pairs: EdgePairs,
    zones: Zones,
    desk: Single,
) -> int:
    """Move what would cross as it was when `safe`, a state without crossings.

    No zone sinks below the height `desk` of what rests on the desk, metres.

    Zones that make others cross anew are joined with these and ever more around them, in the end
    the whole cloth: a state without crossings is never followed by one with them. Edges of
    crossings are watched from then on. Then the present state becomes the safe one.

    Returns how many vertices were in zones.
    """
    leader, wanted = zones.leader, zones.wanted
    moved = 0
    for sweep in range(ROUNDS):
        total = find_crossings(position, triangles, rows, columns, patches, FACING, found)
        if total == 0:
            break
        if sweep == 0:
            leader[:] = -1
            wanted[:, :3] = position
            wanted[:, 3:] = velocity
        if sweep == ROUNDS - 1 or total > found.shape[0]:
            leader[:] = 0
            moved = _move_zones(position, velocity, safe, mobility, zones, desk)
            break
        watch_edges(safe, found, total, pairs)
        for n in range(total):
            for k in range(5):
                _join_around(leader, found[n, 0], found[n, k], rows, columns, sweep)
        moved = _move_zones(position, velocity, safe, mobility, zones, desk)
    safe[:] = position
    return moved


@njit(inline="always")
def _leader_of(leader: IndexArray, vertex: int) -> int:
    while leader[vertex] != vertex:
        leader[vertex] = leader[leader[vertex]]
        vertex = leader[vertex]
    return vertex


@njit(**FAST)
def _join_around(
    leader: IndexArray, first: int, vertex: int, rows: int, columns: int, around: int
) -> None:
    """Join vertices up to `around` rows and columns from `vertex` with the zone of `first`."""
    if leader[first] < 0:
        leader[first] = first
    root = _leader_of(leader, first)
    i, j = vertex // columns, vertex % columns
    for row in range(max(i - around, 0), min(i + around + 1, rows)):
        for column in range(max(j - around, 0), min(j + around + 1, columns)):
            v = row * columns + column
            if leader[v] >= 0:
                leader[_leader_of(leader, v)] = root
            else:
                leader[v] = root


@njit(**FAST)
def _move_zones(
    position: Singles,
    velocity: Singles,
    safe: Singles,
    mobility: NDArray[np.float64],
    zones: Zones,
    desk: Single,
) -> int:
    """Give each zone its safe shape and the mean motion; returns how many vertices are in one."""
    leader, weight, sums, lowest, wanted = zones
    weight[:] = 0.0
    lowest[:] = HIGH
    sums[:] = 0.0
    for v in range(leader.shape[0]):
        if leader[v] < 0:
            continue
        root = _leader_of(leader, v)
        share = 1.0 if mobility[v] > 0.0 else GRIPPED
        weight[root] += share
        lowest[root] = min(lowest[root], safe[v, 2])
        for k in range(3):
            sums[root, k] += share * (wanted[v, k] - safe[v, k])
            sums[root, 3 + k] += share * wanted[v, 3 + k]
    moved = 0
    for v in range(leader.shape[0]):
        if leader[v] < 0:
            continue
        root = _leader_of(leader, v)
        moved += 1
        for k in range(3):
            way = sums[root, k] / weight[root]
            if k == 2:
                way = max(way, min(desk - lowest[root], 0.0))
            position[v, k] = safe[v, k] + np.float32(way)
            velocity[v, k] = sums[root, 3 + k] / weight[root]
    return moved
