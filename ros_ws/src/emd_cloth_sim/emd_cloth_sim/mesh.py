"""The regular mesh of a sheet: vertices, triangles, and who pulls on whom."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emd_core.frames import FloatArray

IndexArray = NDArray[np.int32]


@dataclass(frozen=True)
class SheetMesh:
    """Topology and rest lengths of a sheet; vertex (i, j) has the index i * n_y + j.

    The constraints come in colours: those of one colour share no vertex and are listed together,
    which keeps Gauss-Seidel's error small in every direction and the processor's pipeline full.

    Attributes:
        triangles: Shape (T, 3), counter-clockwise from above; the diagonals alternate, so that
            the mesh has the mirror symmetries of the sheet.
        edges: Structural constraints, shape (E, 2).
        edge_lengths: Rest lengths of the edges, shape (E,), metres.
        right_angles: Shear constraints: the right-angled corner of every triangle, then the ends
            of its legs along x and y, shape (T, 3).
        spans: Pairs that a sharp fold brings together: ends of triples and both diagonals of every
            cell, shape (P, 2).
        span_lengths: Their distances on the flat sheet, shape (P,), metres.
        triples: Bending constraints: three vertices in a row, shape (B, 3).
    """

    triangles: IndexArray
    edges: IndexArray
    edge_lengths: FloatArray
    right_angles: IndexArray
    spans: IndexArray
    span_lengths: FloatArray
    triples: IndexArray


def flat_positions(vertices: tuple[int, int], side_lengths: tuple[float, float]) -> FloatArray:
    """Place the vertices on a centred, axis-parallel rectangle in z = 0; shape (V, 3), metres."""
    x = np.linspace(-0.5, 0.5, vertices[0]) * side_lengths[0]
    y = np.linspace(-0.5, 0.5, vertices[1]) * side_lengths[1]
    grid_x, grid_y = np.meshgrid(x, y, indexing="ij")
    return np.stack([grid_x.ravel(), grid_y.ravel(), np.zeros(grid_x.size)], axis=1)


def build_mesh(vertices: tuple[int, int], spacing: tuple[float, float]) -> SheetMesh:
    """Build the mesh of a sheet with `vertices` along x and y, `spacing` apart (metres)."""
    index = np.arange(vertices[0] * vertices[1], dtype=np.int32).reshape(vertices)
    edges_x, edges_y = _edges_along_x(index), _edges_along_x(index.T)
    lengths = np.concatenate(
        [np.full(len(edges_x), spacing[0]), np.full(len(edges_y), spacing[1])]
    )
    triangles = _triangles(index)
    triples_x, triples_y = _triples_along_x(index), _triples_along_x(index.T)
    diagonals = _diagonals(index)
    return SheetMesh(
        triangles=triangles,
        edges=np.ascontiguousarray(np.concatenate([edges_x, edges_y])),
        edge_lengths=lengths,
        right_angles=_right_angles(index),
        spans=np.ascontiguousarray(
            np.concatenate([triples_x[:, ::2], triples_y[:, ::2], diagonals])
        ),
        span_lengths=np.concatenate(
            [
                np.full(len(triples_x), 2.0 * spacing[0]),
                np.full(len(triples_y), 2.0 * spacing[1]),
                np.full(len(diagonals), np.hypot(*spacing)),
            ]
        ),
        triples=np.ascontiguousarray(np.concatenate([triples_x, triples_y])),
    )


def pair_lengths(positions: FloatArray, pairs: IndexArray) -> FloatArray:
    """Give the distances of pairs of vertices, shape (C,), in the positions' unit."""
    ends = positions[pairs]
    return np.asarray(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))


def cell_diagonals(mesh: SheetMesh) -> tuple[IndexArray, FloatArray]:
    """Give both diagonals of every cell, (2 C, 2), and their lengths, from the mesh's spans."""
    first = len(mesh.triples)
    return mesh.spans[first:], mesh.span_lengths[first:]


def feature_owners(triangles: IndexArray) -> NDArray[np.uint8]:
    """Let one of the triangles around every vertex and edge own it; shape (T,).

    A part of a triangle is named by its corners' bits: 1, 2, 4 for the corners, 3, 5, 6 for the
    sides, 7 for the inside. Bit n of the result says whether the triangle owns part n.
    """
    owners = np.full(len(triangles), 1 << 7, dtype=np.uint8)
    first: dict[tuple[int, ...], int] = {}
    for part in ((0,), (1,), (2,), (0, 1), (0, 2), (1, 2)):
        name = sum(1 << corner for corner in part)
        for triangle, key in enumerate(np.sort(triangles[:, part], axis=1).tolist()):
            if first.setdefault(tuple(key), triangle) == triangle:
                owners[triangle] |= 1 << name
    return owners


def _edges_along_x(index: IndexArray) -> IndexArray:
    pairs = np.stack([index[:-1], index[1:]], axis=-1)
    return np.concatenate([pairs[colour::2].reshape(-1, 2) for colour in range(2)])


def _triples_along_x(index: IndexArray) -> IndexArray:
    triples = np.stack([index[:-2], index[1:-1], index[2:]], axis=-1)
    return np.concatenate([triples[colour::3].reshape(-1, 3) for colour in range(3)])


def _diagonals(index: IndexArray) -> IndexArray:
    falling = np.stack([index[:-1, :-1], index[1:, 1:]], axis=-1)
    rising = np.stack([index[1:, :-1], index[:-1, 1:]], axis=-1)
    return np.concatenate(
        [pairs[colour::2].reshape(-1, 2) for pairs in (falling, rising) for colour in range(2)]
    )


def _right_angles(index: IndexArray) -> IndexArray:
    """Corners of the triangles of `_triangles`, grouped so that none of a group share a vertex."""
    low, x_next = index[:-1, :-1], index[1:, :-1]
    y_next, high = index[:-1, 1:], index[1:, 1:]
    rows, columns = np.indices(low.shape)
    even = ((rows + columns) % 2 == 0)[..., None]
    first = np.where(even, np.stack([x_next, low, high], -1), np.stack([low, x_next, y_next], -1))
    second = np.where(
        even, np.stack([y_next, high, low], -1), np.stack([high, y_next, x_next], -1)
    )
    groups = [
        corners[i::2, j::2].reshape(-1, 3)
        for i in range(2)
        for j in range(2)
        for corners in (first, second)
    ]
    return np.ascontiguousarray(np.concatenate(groups), dtype=np.int32)


def _triangles(index: IndexArray) -> IndexArray:
    low, x_next = index[:-1, :-1], index[1:, :-1]
    y_next, high = index[:-1, 1:], index[1:, 1:]
    rows, columns = np.indices(low.shape)
    even = (rows + columns) % 2 == 0
    first = np.where(
        even[..., None],
        np.stack([low, x_next, high], axis=-1),
        np.stack([low, x_next, y_next], axis=-1),
    )
    second = np.where(
        even[..., None],
        np.stack([low, high, y_next], axis=-1),
        np.stack([x_next, high, y_next], axis=-1),
    )
    return np.ascontiguousarray(np.stack([first, second], axis=2).reshape(-1, 3), dtype=np.int32)
