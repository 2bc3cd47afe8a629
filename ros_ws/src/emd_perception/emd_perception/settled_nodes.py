"""Nodes of a cut whose side needs no search, as their own preference outweighs all their arcs.

In pictures of clear colours these are most (known as dominance or persistency in the literature of
graph cuts); each one that is settled may settle its neighbours.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

SOURCE, SINK, OPEN = 1, -1, 0


@numba.njit(cache=True, nogil=True, error_model="numpy")
def settle(
    neighbours: NDArray[np.int32],
    capacity: NDArray[np.int32],
    terminal: NDArray[np.int32],
    side: NDArray[np.int8],
) -> None:
    """Find the side of such nodes in the smallest minimum cut, and take them out of the graph.

    Args:
        neighbours: As `emd_perception.minimum_cut.source_side` takes them, shape (N, 8).
        capacity: Of the arcs; those of settled nodes become 0, shape (N, 8).
        terminal: Preferences; arcs to settled nodes are added to those of their other ends, and
            settled nodes have none left, shape (N,).
        side: Filled with SOURCE, SINK or OPEN, shape (N,).
    """
    count = len(terminal)
    outgoing, incoming = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
    for node in range(count):
        side[node] = OPEN
        for way in range(8):
            other = neighbours[node, way]
            if other >= 0:
                outgoing[node] += capacity[node, way]
                incoming[other] += capacity[node, way]
    stack, waiting = np.arange(count), np.ones(count, dtype=np.bool_)
    left = count
    while left > 0:
        left -= 1
        node = stack[left]
        waiting[node] = False
        if terminal[node] > outgoing[node]:
            side[node] = SOURCE
        elif -terminal[node] >= incoming[node]:  # where both sides are as good, the sink's
            side[node] = SINK
        else:
            continue
        terminal[node] = 0
        for way in range(8):
            other = neighbours[node, way]
            if other < 0 or side[other] != OPEN:
                continue
            to, back = capacity[node, way], capacity[other, 7 - way]
            terminal[other] += to if side[node] == SOURCE else -back
            outgoing[other] -= back
            incoming[other] -= to
            capacity[node, way] = capacity[other, 7 - way] = 0
            if not waiting[other]:
                waiting[other] = True
                stack[left] = other
                left += 1
