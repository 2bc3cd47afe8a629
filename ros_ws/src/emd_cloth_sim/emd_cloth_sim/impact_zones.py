"""Undoing crossings: what would pass through itself moves on as one piece.

Vertices that take part in a crossing become a zone that follows the mean of its vertices' motion
(impact zones; Provot, 1997; Bridson et al., 2002, here without turning). They keep half of their
own motion within it, and if they still cross, none, so that the zone is rigid there. So a tangle
is carried along with the cloth around it rather than left behind, and what is stretched in it can
still relax.
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
# Share of its own motion that a vertex keeps when it is found in a crossing first; then none.
FIRST_GIVE = np.float32(0.5)
# Rounds in which only what crosses joins a zone, before what is around it does.
ALONE = 6
ZERO, ONE = np.float32(0.0), np.float32(1.0)
# Rounds of enlarging zones before the whole cloth is one.
ROUNDS = 20
# What a vertex in a rigid grip counts in the mean; a free one counts 1 at most.
GRIPPED = 1e8
HIGH = 1e30


class Zones(NamedTuple):
    """Memory for the zones of one repair.

    Attributes:
        give: Share of its own motion within the zone that each vertex makes, shape (V,).
        leader: Another vertex of the same zone, itself if it leads it, -1 outside, shape (V,).
        weight: Of each leader's zone, shape (V,).
        sums: Weighted way and velocity of each leader's zone, shape (V, 6).
        lowest: Of each leader's zone when it was safe, metres, shape (V,).
        wanted: Position and velocity that each vertex would have without zones, shape (V, 6).
    """

    give: Singles
    leader: IndexArray
    weight: NDArray[np.float64]
    sums: NDArray[np.float64]
    lowest: NDArray[np.float64]
    wanted: Singles


def allocate_zones(vertices: int) -> Zones:
    """Make memory for a cloth of so many vertices."""
    return Zones(
        np.empty(vertices, np.float32),
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

    Zones that make others cross anew are joined with these, later with ever more around them, in
    the end with the whole cloth: a state without crossings is never followed by one with them.
    Edges of crossings are watched from then on. Then the present state becomes the safe one.

    Returns how many vertices were in zones.
    """
    leader, give, wanted = zones.leader, zones.give, zones.wanted
    moved = 0
    for sweep in range(ROUNDS):
        total = find_crossings(position, triangles, rows, columns, patches, FACING, found)
        if total == 0:
            break
        if sweep == 0:
            leader[:] = -1
            give[:] = ONE
            wanted[:, :3] = position
            wanted[:, 3:] = velocity
        if sweep == ROUNDS - 1 or total > found.shape[0]:
            leader[:] = 0
            give[:] = ZERO
            moved = _move_zones(position, velocity, safe, mobility, zones, desk)
            break
        watch_edges(safe, found, total, pairs)
        around, share = max(sweep - ALONE, 0), FIRST_GIVE if sweep == 0 else ZERO
        for n in range(total):
            for k in range(5):
                _join_around(leader, give, share, found[n, 0], found[n, k], rows, columns, around)
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
    leader: IndexArray,
    give: Singles,
    share: Single,
    first: int,
    vertex: int,
    rows: int,
    columns: int,
    around: int,
) -> None:
    """Join vertices up to `around` rows and columns from `vertex` with the zone of `first`.

    They keep no more than a share of their own motion.
    """
    if leader[first] < 0:
        leader[first] = first
    root = _leader_of(leader, first)
    i, j = vertex // columns, vertex % columns
    for row in range(max(i - around, 0), min(i + around + 1, rows)):
        for column in range(max(j - around, 0), min(j + around + 1, columns)):
            v = row * columns + column
            give[v] = min(give[v], share)
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
    """Give each zone its mean motion and the share of their own that its vertices keep.

    Returns how many vertices are in a zone.
    """
    give, leader, weight, sums, lowest, wanted = zones
    weight[:] = 0.0
    lowest[:] = HIGH
    sums[:] = 0.0
    for v in range(leader.shape[0]):
        if leader[v] < 0:
            continue
        root = _leader_of(leader, v)
        # Weighed by what the vertices give up, the mean keeps their momentum.
        share = ONE - give[v] if mobility[v] > 0.0 else GRIPPED
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
            speed = sums[root, 3 + k] / weight[root]
            own = wanted[v, k] - safe[v, k] - way
            position[v, k] = safe[v, k] + np.float32(way + give[v] * own)
            velocity[v, k] = speed + give[v] * (wanted[v, 3 + k] - speed)
    return moved
