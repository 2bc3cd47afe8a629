"""Whether a simulated state can be believed: stretch, crossings, NaN, depth below the desk."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emd_cloth_sim.broad_phase import make_patches
from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.crossings import EVERYWHERE, find_crossings
from emd_cloth_sim.mesh import SheetMesh, pair_lengths
from emd_core.errors import SimulationError
from emd_core.frames import FloatArray

# Sides that cross and are told apart; a mesh that has more is hopeless anyway.
MAX_LISTED = 20_000


@dataclass(frozen=True)
class ClothDiagnostics:
    """What may be wrong with a state.

    Attributes:
        stretch_p99: 99th percentile of edge length over rest length.
        worst_stretch: The greatest of these ratios.
        crossings: Pairs of a triangle's side and a triangle that pass through each other.
        desk_depth: Deepest reach of the mid-surface below its height at rest on the desk, metres.
        finite: Whether no coordinate is NaN or infinite.
        max_stretch: Greatest `stretch_p99` that can be believed, less one.
        max_desk_depth: Greatest `desk_depth` that can be believed, metres.
    """

    stretch_p99: float
    worst_stretch: float
    crossings: int
    desk_depth: float
    finite: bool
    max_stretch: float
    max_desk_depth: float

    @property
    def stretched(self) -> bool:
        """Whether the cloth is stretched farther than can be believed."""
        return self.finite and self.stretch_p99 > 1.0 + self.max_stretch

    @property
    def failure(self) -> str:
        """What makes the state unusable; empty if nothing does."""
        if not self.finite:
            return "a vertex has no finite position"
        if self.stretched:
            return f"stretch p99 {self.stretch_p99:.3f} is above {1.0 + self.max_stretch:.3f}"
        if self.crossings > 0:
            return f"the cloth passes through itself at {self.crossings} places"
        if self.desk_depth > self.max_desk_depth:
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
    config: ClothConfig,
    edge_lengths: FloatArray | None = None,
) -> ClothDiagnostics:
    """Examine mid-surface positions, shape (V, 3), metres.

    Args:
        position: The vertices.
        mesh: The sheet's mesh.
        config: The sheet; says what can be believed.
        edge_lengths: Rest lengths of the mesh's edges, metres; the flat sheet's if None.
    """
    limits = (config.max_stretch, 0.5 * config.thickness)
    if not np.isfinite(position).all():
        return ClothDiagnostics(np.inf, np.inf, 0, np.inf, False, *limits)
    lengths = mesh.edge_lengths if edge_lengths is None else edge_lengths
    ratio = pair_lengths(position, mesh.edges) / lengths
    return ClothDiagnostics(
        float(np.percentile(ratio, 99)),
        float(ratio.max()),
        count_crossings(position, mesh, config.vertices),
        float(max(0.0, config.rest_height - position[:, 2].min())),
        True,
        *limits,
    )


def count_crossings(position: FloatArray, mesh: SheetMesh, vertices: tuple[int, int]) -> int:
    """Count what `list_crossings` lists."""
    return len(list_crossings(position, mesh, vertices))


def list_crossings(
    position: FloatArray, mesh: SheetMesh, vertices: tuple[int, int]
) -> NDArray[np.int32]:
    """List the pairs of a triangle's side and a triangle, without a common vertex, that cross.

    Args:
        position: Shape (V, 3), metres.
        mesh: The sheet.
        vertices: Its counts of vertices along x and y.

    Returns:
        The side's two vertices, then the triangle's three, shape (M, 5), `MAX_LISTED` at most.
    """
    found = np.empty((MAX_LISTED, 5), dtype=np.int32)
    total = find_crossings(
        position.astype(np.float32),
        mesh.triangles,
        *vertices,
        make_patches(vertices),
        EVERYWHERE,
        found,
    )
    listed = found[: min(total, MAX_LISTED)]
    listed[:, :2].sort(axis=1)
    return np.unique(listed, axis=0)
