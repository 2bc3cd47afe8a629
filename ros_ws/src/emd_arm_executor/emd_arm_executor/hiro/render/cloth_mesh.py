"""The cloth's look: a thin slab with an outer and an inner side and a hem."""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
from numpy.typing import NDArray

from emd_arm_executor.hiro.render.mesh import Colour, Mesh, Segment, make_mesh
from emd_core.frames import FloatArray

IndexArray = NDArray[np.int32]


class ClothMesher:
    """Turns the mid-surface of a cloth into a closed slab of its thickness.

    What a camera sees of a cloth is not its mid-surface but lies half the thickness nearer, on
    whichever side it looks at.
    """

    def __init__(
        self, triangles: IndexArray, thickness: float, outside: Colour, inside: Colour
    ) -> None:
        """Prepare for a cloth's topology.

        Args:
            triangles: Shape (T, 3), counter-clockwise seen from the upper (outer) side.
            thickness: Metres.
            outside: Colour of the side from which triangles are counter-clockwise.
            inside: Colour of the other side.
        """
        self._triangles = np.ascontiguousarray(triangles, dtype=np.int32)
        self._thickness = thickness
        count = int(self._triangles.max()) + 1
        both_sides = [self._triangles, self._triangles[:, ::-1] + count]
        walls = _hem_walls(_hem_edges(self._triangles), count)
        unknown = np.zeros((2 * count, 3))
        slab = np.concatenate([*both_sides, walls])
        self._slab = make_mesh(unknown, unknown, slab, outside, Segment.CLOTH, smooth=True)
        self._slab.colours[len(triangles) : 2 * len(triangles)] = inside

    def paint(self, colours: NDArray[np.float32]) -> None:
        """Give both sides of the triangles colours, shape (T, 3), 0..1."""
        self._slab.colours[: 2 * len(colours)] = np.tile(colours, (2, 1))

    def mesh(self, positions: FloatArray) -> Mesh:
        """Give the slab around mid-surface positions, shape (V, 3), in their frame."""
        normals = vertex_normals(np.ascontiguousarray(positions), self._triangles)
        offset = 0.5 * self._thickness * normals
        vertices = np.concatenate([positions + offset, positions - offset])
        return replace(self._slab, vertices=vertices, normals=np.concatenate([normals, -normals]))


@numba.njit(cache=True, nogil=True)
def vertex_normals(positions: FloatArray, triangles: IndexArray) -> FloatArray:
    """Area-weighted unit normals of the vertices, shape (V, 3)."""
    normals = np.zeros_like(positions)
    for t in range(len(triangles)):
        a, b, c = triangles[t]
        ux = positions[b, 0] - positions[a, 0]
        uy = positions[b, 1] - positions[a, 1]
        uz = positions[b, 2] - positions[a, 2]
        vx = positions[c, 0] - positions[a, 0]
        vy = positions[c, 1] - positions[a, 1]
        vz = positions[c, 2] - positions[a, 2]
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        for vertex in (a, b, c):
            normals[vertex, 0] += nx
            normals[vertex, 1] += ny
            normals[vertex, 2] += nz
    for v in range(len(normals)):
        length = np.sqrt(normals[v, 0] ** 2 + normals[v, 1] ** 2 + normals[v, 2] ** 2)
        if length > 0.0:
            normals[v] /= length
        else:
            normals[v, 2] = 1.0
    return normals


def _hem_edges(triangles: IndexArray) -> IndexArray:
    """Directed edges that belong to one triangle only, shape (E, 2)."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    keys = np.sort(edges, axis=1)
    _, first, counts = np.unique(keys, axis=0, return_index=True, return_counts=True)
    return edges[first[counts == 1]]


def _hem_walls(hem: IndexArray, count: int) -> IndexArray:
    """Walls between the sides; vertices 0..count are the upper, count..2 count the lower ones."""
    here, there = hem[:, 0], hem[:, 1]
    return np.concatenate(
        [
            np.stack([here, here + count, there + count], axis=1),
            np.stack([here, there + count, there], axis=1),
        ]
    )
