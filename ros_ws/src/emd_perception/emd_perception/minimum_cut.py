"""Minimum cut of a graph of pixels, each linked with its eight neighbours.

The augmenting-path search with two trees of Boykov and Kolmogorov ("An Experimental Comparison of
Min-Cut/Max-Flow Algorithms for Energy Minimization in Vision", PAMI 2004), in Numba. Neighbours
are numbered so that the way back from the k-th one is its own neighbour 7 - k.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from emd_perception.settled_nodes import SOURCE, settle

_NONE = -1  # no parent: the node belongs to no tree
_TERMINAL = 8  # its parent is source or sink itself
_ORPHAN = 9  # its parent was lost, a new one is looked for
_FAR = 1 << 30

_Integers = NDArray[np.int32]
_Ways = NDArray[np.int8]  # directions to parents
_Flags = NDArray[np.bool_]


def source_side(
    neighbours: NDArray[np.int32], capacities: NDArray[np.int32], preference: NDArray[np.int32]
) -> NDArray[np.bool_]:
    """Find the smallest set of nodes with the source among all minimum cuts.

    Args:
        neighbours: Nodes beside each node, negative where none is, shape (N, 8); if j is the
            k-th neighbour of i, then i is the (7 - k)-th of j.
        capacities: Of the arcs to them, not negative, shape (N, 8).
        preference: Capacity from the source where positive, to the sink where negative, shape
            (N,).

    Returns:
        Which nodes stay with the source, shape (N,).
    """
    count = len(preference)
    capacity, terminal = capacities.copy(), preference.copy()
    side = np.empty(count, dtype=np.int8)
    settle(neighbours, capacity, terminal, side)
    parent = np.full(count, _NONE, dtype=np.int8)
    in_sink_tree = np.zeros(count, dtype=np.bool_)
    _cut(neighbours, capacity, terminal, parent, in_sink_tree)
    return np.asarray((side == SOURCE) | ((parent != _NONE) & ~in_sink_tree))


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _cut(
    neighbours: _Integers,
    capacity: _Integers,
    terminal: _Integers,
    parent: _Ways,
    in_sink_tree: _Flags,
) -> None:
    """Grow both trees until no path is left; capacities become what is left of them."""
    count = len(terminal)
    stamp = np.zeros(count, dtype=np.int32)  # when a node's distance was last known to be right
    distance = np.zeros(count, dtype=np.int32)  # from its terminal
    # Rings of nodes with their first place and length; a node is in each at most once.
    active, orphans = np.empty(count, dtype=np.int32), np.empty(count, dtype=np.int32)
    ends = np.zeros(4, dtype=np.int64)  # first and length of `active`, first and length of orphans
    waiting = np.zeros(count, dtype=np.bool_)
    for node in range(count):
        if terminal[node] != 0:
            parent[node] = _TERMINAL
            in_sink_tree[node] = terminal[node] < 0
            distance[node] = 1
            _activate(node, active, ends, waiting)
    time = 0
    while ends[1] > 0:
        node = active[ends[0]]
        if parent[node] != _NONE:
            link = _grow(
                node, neighbours, capacity, parent, in_sink_tree, stamp, distance, active, ends,
                waiting,
            )  # fmt: skip
            time += 1
            if link >= 0:  # the node stays first: more paths may lead through it
                _augment(
                    link >> 3, link & 7, neighbours, capacity, terminal, parent, orphans, ends
                )
                _adopt(
                    time, neighbours, capacity, parent, in_sink_tree, stamp, distance, active,
                    orphans, ends, waiting,
                )  # fmt: skip
                continue
        waiting[node] = False
        ends[0] = (ends[0] + 1) % count
        ends[1] -= 1


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _activate(
    node: int,
    active: _Integers,
    ends: NDArray[np.int64],
    waiting: _Flags,
) -> None:
    if not waiting[node]:
        waiting[node] = True
        active[(ends[0] + ends[1]) % len(active)] = node
        ends[1] += 1


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _orphan(
    node: int,
    parent: _Ways,
    orphans: _Integers,
    ends: NDArray[np.int64],
) -> None:
    parent[node] = _ORPHAN
    orphans[(ends[2] + ends[3]) % len(orphans)] = node
    ends[3] += 1


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _grow(
    node: int,
    neighbours: _Integers,
    capacity: _Integers,
    parent: _Ways,
    in_sink_tree: _Flags,
    stamp: _Integers,
    distance: _Integers,
    active: _Integers,
    ends: NDArray[np.int64],
    waiting: _Flags,
) -> int:
    """Let a node take free neighbours into its tree; give the arc to the other tree, or -1.

    An arc is eight times its first node plus its direction, from the source's tree to the sink's.
    """
    sink = in_sink_tree[node]
    for way in range(8):
        other = neighbours[node, way]
        if other < 0 or (capacity[other, 7 - way] if sink else capacity[node, way]) == 0:
            continue
        if parent[other] == _NONE:
            in_sink_tree[other] = sink
            _activate(other, active, ends, waiting)
        elif in_sink_tree[other] != sink:
            return 8 * other + 7 - way if sink else 8 * node + way
        elif stamp[other] > stamp[node] or distance[other] <= distance[node]:
            continue
        # A free node, or one that comes nearer to its terminal this way.
        parent[other] = 7 - way
        stamp[other] = stamp[node]
        distance[other] = distance[node] + 1
    return -1


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _augment(
    tail: int,
    way: int,
    neighbours: _Integers,
    capacity: _Integers,
    terminal: _Integers,
    parent: _Ways,
    orphans: _Integers,
    ends: NDArray[np.int64],
) -> None:
    """Fill the path from source to sink through an arc; nodes behind full arcs lose parents."""
    head = neighbours[tail, way]
    flow = capacity[tail, way]
    node = tail
    while parent[node] != _TERMINAL:
        up = neighbours[node, parent[node]]
        flow = min(flow, capacity[up, 7 - parent[node]])
        node = up
    flow = min(flow, terminal[node])
    node = head
    while parent[node] != _TERMINAL:
        flow = min(flow, capacity[node, parent[node]])
        node = neighbours[node, parent[node]]
    flow = min(flow, -terminal[node])
    capacity[tail, way] -= flow
    capacity[head, 7 - way] += flow
    node = head
    while parent[node] < _TERMINAL:
        towards = parent[node]
        up = neighbours[node, towards]
        capacity[node, towards] -= flow
        capacity[up, 7 - towards] += flow
        if capacity[node, towards] == 0:
            _orphan(node, parent, orphans, ends)
        node = up
    terminal[node] += flow
    if terminal[node] == 0:
        _orphan(node, parent, orphans, ends)
    node = tail
    while parent[node] < _TERMINAL:
        towards = parent[node]
        up = neighbours[node, towards]
        capacity[node, towards] += flow
        capacity[up, 7 - towards] -= flow
        if capacity[up, 7 - towards] == 0:
            _orphan(node, parent, orphans, ends)
        node = up
    terminal[node] -= flow
    if terminal[node] == 0:
        _orphan(node, parent, orphans, ends)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _adopt(
    time: int,
    neighbours: _Integers,
    capacity: _Integers,
    parent: _Ways,
    in_sink_tree: _Flags,
    stamp: _Integers,
    distance: _Integers,
    active: _Integers,
    orphans: _Integers,
    ends: NDArray[np.int64],
    waiting: _Flags,
) -> None:
    """Find new parents in the same tree for orphans; those without become free."""
    while ends[3] > 0:
        node = orphans[ends[2]]
        ends[2] = (ends[2] + 1) % len(orphans)
        ends[3] -= 1
        sink = in_sink_tree[node]
        nearest, best = _FAR, _NONE
        for way in range(8):
            other = neighbours[node, way]
            if other < 0 or parent[other] == _NONE or in_sink_tree[other] != sink:
                continue
            if (capacity[node, way] if sink else capacity[other, 7 - way]) == 0:
                continue
            far = _distance_from_terminal(other, time, neighbours, parent, stamp, distance)
            if far < nearest:
                nearest, best = far, way
        parent[node] = best
        if best != _NONE:
            stamp[node], distance[node] = time, nearest + 1
            continue
        for way in range(8):
            other = neighbours[node, way]
            if other < 0 or parent[other] == _NONE or in_sink_tree[other] != sink:
                continue
            if (capacity[node, way] if sink else capacity[other, 7 - way]) > 0:
                _activate(other, active, ends, waiting)
            if parent[other] == 7 - way:
                _orphan(other, parent, orphans, ends)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _distance_from_terminal(
    start: int,
    time: int,
    neighbours: _Integers,
    parent: _Ways,
    stamp: _Integers,
    distance: _Integers,
) -> int:
    """Steps up to the terminal, or very many if an orphan lies on the way."""
    steps, node = 0, start
    while stamp[node] != time:
        towards = parent[node]
        if towards == _ORPHAN:
            return _FAR
        steps += 1
        if towards == _TERMINAL:
            stamp[node], distance[node] = time, 1
            break
        node = neighbours[node, towards]
    else:
        steps += distance[node]
    far, node = steps, start
    while stamp[node] != time:
        stamp[node], distance[node] = time, steps
        steps -= 1
        node = neighbours[node, parent[node]]
    return far
