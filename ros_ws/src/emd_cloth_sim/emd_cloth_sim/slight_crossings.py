"""Parting layers that cross by less than a hair, as rounding of stored vertices makes them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from emd_cloth_sim.crossings import crosses
from emd_cloth_sim.diagnostics import list_crossings
from emd_cloth_sim.mesh import SheetMesh
from emd_core.frames import FloatArray

# How far apart what crossed is put, metres.
_GAP = 3e-5
_ROUNDS = 40


def part_slight_crossings(
    positions: FloatArray, mesh: SheetMesh, vertices: tuple[int, int], most: float = 1e-3
) -> FloatArray:
    """Move vertices the shortest way out of what they cross, again and again.

    A side that passes through a triangle leaves it over its own end, or past one of the triangle's
    sides, whichever is nearer; both move by half of the way.

    Args:
        positions: Mid-surface (V, 3), metres.
        mesh: Its mesh.
        vertices: Its counts of vertices along x and y.
        most: Longest way that a vertex may move in a round, metres: what crosses by more is left
            as it is.

    Returns:
        New positions; `ClothDiagnostics.crossings` tells whether all is parted.
    """
    moved = np.array(positions, dtype=np.float64)
    for _ in range(_ROUNDS):
        crossings = list_crossings(moved, mesh, vertices)
        if not len(crossings):
            break
        for crossing in crossings:
            # A side of two triangles is listed with both; one move parts it from both.
            if crosses(moved, *crossing):
                _part(moved, crossing, most)
        # The cloth computes in single precision.
        moved = moved.astype(np.float32).astype(np.float64)
    return moved


def _part(moved: FloatArray, crossing: NDArray[np.int32], most: float) -> None:
    """Move a side p q and a triangle a b c apart."""
    p, q, *corners = crossing
    a, b, c = corners
    ways: list[tuple[float, FloatArray, list[int], list[int]]] = []
    normal = _unit(np.cross(moved[b] - moved[a], moved[c] - moved[a]))
    for end in (p, q):
        ways.append((float((moved[a] - moved[end]) @ normal), normal, [end], corners))
    for one, other in ((a, b), (b, c), (c, a)):
        across = _unit(np.cross(moved[q] - moved[p], moved[other] - moved[one]))
        ways.append((float((moved[one] - moved[p]) @ across), across, [p, q], [one, other]))
    way, direction, ours, theirs = min(ways, key=lambda entry: abs(entry[0]))
    if abs(way) > most or not direction.any():
        return
    half = 0.5 * (way + np.copysign(_GAP, way)) * direction
    moved[ours] += half
    moved[theirs] -= half


def _unit(vector: FloatArray) -> FloatArray:
    length = float(np.linalg.norm(vector))
    return vector / length if length > 1e-15 else np.zeros(3)
