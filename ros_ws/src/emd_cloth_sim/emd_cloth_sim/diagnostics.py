"""Whether a simulated state can be believed: stretch, crossings, NaN, depth below the desk."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from emd_cloth_sim.broad_phase import Cells, allocate_cells, sort_into_cells
from emd_cloth_sim.mesh import IndexArray, SheetMesh, pair_lengths
from emd_core.errors import SimulationError
from emd_core.frames import FloatArray

MAX_STRETCH_P99 = 1.05
# Two hems that interlock for one cell make 2 to 4 pairs, a blemish of a few millimetres that no
# voxel shows; layers that went through each other make dozens.
MAX_CROSSINGS = 8
MAX_DESK_DEPTH = 1e-3


@dataclass(frozen=True)
class ClothDiagnostics:
    """What may be wrong with a state.

    Attributes:
        stretch_p99: 99th percentile of edge length over rest length.
        worst_stretch: The greatest of these ratios.
        crossings: Pairs of an edge and a triangle that pass through each other.
        desk_depth: Deepest reach of the mid-surface below half a thickness over the desk, metres.
        finite: Whether no coordinate is NaN or infinite.
    """

    stretch_p99: float
    worst_stretch: float
    crossings: int
    desk_depth: float
    finite: bool

    @property
    def failure(self) -> str:
        """What makes the state unusable; empty if nothing does."""
        if not self.finite:
            return "a vertex has no finite position"
        if self.stretch_p99 > MAX_STRETCH_P99:
            return f"stretch p99 {self.stretch_p99:.3f} is above {MAX_STRETCH_P99}"
        if self.crossings > MAX_CROSSINGS:
            return f"the cloth passes through itself at {self.crossings} places"
        if self.desk_depth > MAX_DESK_DEPTH:
            return f"the cloth is {1e3 * self.desk_depth:.1f} mm below the desk"
        return ""

    def raise_on_failure(self) -> None:
        """Raise if the state is unusable.

        Raises:
            SimulationError: With the first thing that is wrong.
        """
        if self.failure:
            raise SimulationError(
                f"the cloth's state cannot be used: {self.failure}; move the hands more slowly, "
                "or raise ClothConfig.substeps"
            )


def diagnose(
    position: FloatArray,
    mesh: SheetMesh,
    thickness: float,
    edge_lengths: FloatArray | None = None,
    desk_gap: float = 0.0,
) -> ClothDiagnostics:
    """Examine mid-surface positions, shape (V, 3), metres.

    Args:
        position: The vertices.
        mesh: The sheet's mesh.
        thickness: Distance that two layers keep, metres.
        edge_lengths: Rest lengths of the mesh's edges, metres; the flat sheet's if None.
        desk_gap: Height over the desk at which the cloth's underside rests, metres.
    """
    if not np.isfinite(position).all():
        return ClothDiagnostics(np.inf, np.inf, 0, np.inf, False)
    lengths = mesh.edge_lengths if edge_lengths is None else edge_lengths
    ratio = pair_lengths(position, mesh.edges) / lengths
    return ClothDiagnostics(
        stretch_p99=float(np.percentile(ratio, 99)),
        worst_stretch=float(ratio.max()),
        crossings=count_crossings(position, mesh),
        desk_depth=float(max(0.0, desk_gap + 0.5 * thickness - position[:, 2].min())),
        finite=True,
    )


def count_crossings(position: FloatArray, mesh: SheetMesh) -> int:
    """Count the pairs of edge and triangle, without a common vertex, that intersect."""
    corners = position[mesh.triangles]
    centres = corners.mean(axis=1)
    radius = float(np.linalg.norm(corners - centres[:, None], axis=2).max())
    ends = position[mesh.edges]
    reach = radius + 0.5 * float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).max())
    cells = allocate_cells(len(centres))
    cells.points[:] = centres
    return int(_count_crossings(position, mesh.triangles, mesh.edges, reach, cells))


@njit(cache=True)
def _count_crossings(
    position: FloatArray, triangles: IndexArray, edges: IndexArray, reach: float, cells: Cells
) -> int:
    order, first = cells.order, cells.first
    low, cell, count = sort_into_cells(cells, reach)
    crossings = 0
    for e in range(edges.shape[0]):
        p, q = edges[e, 0], edges[e, 1]
        middle = 0.5 * (position[p] + position[q])
        i, j, k = np.floor((middle - low) / cell).astype(np.int64)
        for ci in range(max(i - 1, 0), min(i + 2, count[0])):
            for cj in range(max(j - 1, 0), min(j + 2, count[1])):
                for ck in range(max(k - 1, 0), min(k + 2, count[2])):
                    row = (ci * count[1] + cj) * count[2] + ck
                    for n in range(first[row], first[row + 1]):
                        t = order[n]
                        if _crosses(position, p, q, triangles[t]):
                            crossings += 1
    return crossings


@njit(cache=True)
def _crosses(position: FloatArray, p: int, q: int, triangle: IndexArray) -> bool:
    """Whether segment p-q passes through a triangle (signed volumes of four tetrahedra)."""
    a, b, c = triangle[0], triangle[1], triangle[2]
    if p == a or p == b or p == c or q == a or q == b or q == c:
        return False
    if _volume(position, a, b, c, p) * _volume(position, a, b, c, q) >= 0.0:
        return False
    first = _volume(position, p, q, a, b)
    second = _volume(position, p, q, b, c)
    third = _volume(position, p, q, c, a)
    return (first > 0.0 and second > 0.0 and third > 0.0) or (
        first < 0.0 and second < 0.0 and third < 0.0
    )


@njit(cache=True)
def _volume(position: FloatArray, a: int, b: int, c: int, d: int) -> float:
    """Six times the signed volume of the tetrahedron a, b, c, d."""
    u0, u1, u2 = (
        position[b, 0] - position[a, 0],
        position[b, 1] - position[a, 1],
        position[b, 2] - position[a, 2],
    )
    v0, v1, v2 = (
        position[c, 0] - position[a, 0],
        position[c, 1] - position[a, 1],
        position[c, 2] - position[a, 2],
    )
    w0, w1, w2 = (
        position[d, 0] - position[a, 0],
        position[d, 1] - position[a, 1],
        position[d, 2] - position[a, 2],
    )
    return (u1 * v2 - u2 * v1) * w0 + (u2 * v0 - u0 * v2) * w1 + (u0 * v1 - u1 * v0) * w2
