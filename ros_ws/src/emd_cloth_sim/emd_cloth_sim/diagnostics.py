"""Whether a simulated state can be believed: stretch, crossings, NaN, depth below the desk."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from emd_cloth_sim.broad_phase import make_patches
from emd_cloth_sim.crossings import EVERYWHERE, find_crossings
from emd_cloth_sim.mesh import SheetMesh
from emd_core.errors import SimulationError
from emd_core.frames import FloatArray

MAX_STRETCH_P99 = 1.05
MAX_CROSSINGS = 0
# Sides that cross and are told apart; a mesh that has more is hopeless anyway.
MAX_LISTED = 20_000
MAX_DESK_DEPTH = 1e-3


@dataclass(frozen=True)
class ClothDiagnostics:
    """What may be wrong with a state.

    Attributes:
        stretch_p99: 99th percentile of edge length over rest length.
        worst_stretch: The greatest of these ratios.
        crossings: Pairs of a triangle's side and a triangle that pass through each other.
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
    position: FloatArray, mesh: SheetMesh, vertices: tuple[int, int], thickness: float
) -> ClothDiagnostics:
    """Examine mid-surface positions, shape (V, 3), metres."""
    if not np.isfinite(position).all():
        return ClothDiagnostics(np.inf, np.inf, 0, np.inf, False)
    ends = position[mesh.edges]
    ratio = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / mesh.edge_lengths
    return ClothDiagnostics(
        stretch_p99=float(np.percentile(ratio, 99)),
        worst_stretch=float(ratio.max()),
        crossings=count_crossings(position, mesh, vertices),
        desk_depth=float(max(0.0, 0.5 * thickness - position[:, 2].min())),
        finite=True,
    )


def count_crossings(position: FloatArray, mesh: SheetMesh, vertices: tuple[int, int]) -> int:
    """Count the pairs of a triangle's side and a triangle, without a common vertex, that cross.

    Args:
        position: Shape (V, 3), metres.
        mesh: The sheet.
        vertices: Its counts of vertices along x and y.
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
    return len(np.unique(listed, axis=0))
