"""A hand that holds vertices in its tool frame."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from emd_cloth_sim.mesh import IndexArray
from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray, inverse_transform, transform_points
from emd_core.simulated_cloth import Jaws


@dataclass
class Hand:
    """What a hand holds, where it is and where it is going.

    Attributes:
        held: Indices of the held vertices, shape (H,).
        held_in_tool: Their places in the tool frame, shape (H, 3), metres.
        slip: How far they may be pulled from there before they are lost, metres.
        current: Tool frame now, 4 x 4, tool to table.
        target: Tool frame at the end of the next advance.
    """

    held: IndexArray = field(default_factory=lambda: np.empty(0, np.int32))
    held_in_tool: FloatArray = field(default_factory=lambda: np.empty((0, 3)))
    slip: float = math.inf
    current: FloatArray = field(default_factory=lambda: np.eye(4))
    target: FloatArray = field(default_factory=lambda: np.eye(4))

    def close(
        self,
        transform: FloatArray,
        held: IndexArray,
        positions: FloatArray,
        jaws: Jaws | None = None,
    ) -> None:
        """Take hold of vertices at the given tool frame; without `jaws` nothing is ever lost."""
        self.held = held
        self.held_in_tool = transform_points(inverse_transform(transform), positions[held])
        self.slip = math.inf if jaws is None else jaws.slip
        self.current = transform
        self.target = transform

    def open(self) -> None:
        """Let go of everything."""
        self.held = np.empty(0, np.int32)
        self.held_in_tool = np.empty((0, 3))

    @property
    def may_lose(self) -> bool:
        """Whether it holds something that can slip out."""
        return len(self.held) > 0 and math.isfinite(self.slip)

    def lose_slipped(self, progress: float, positions: FloatArray) -> bool:
        """Let go of what has been pulled out of the fingers.

        Args:
            progress: How far the hand is on the way to its target, 0..1.
            positions: Of all vertices, (V, 3), metres.

        Returns:
            Whether there was any.
        """
        pulled = positions[self.held] - self.held_positions(progress)
        kept = np.linalg.norm(pulled, axis=1) <= self.slip
        self.held, self.held_in_tool = self.held[kept], self.held_in_tool[kept]
        return not kept.all()

    def held_positions(self, progress: float) -> FloatArray:
        """Where the held vertices belong, part of the way to the target; shape (H, 3), metres."""
        return transform_points(
            interpolate_pose(self.current, self.target, progress), self.held_in_tool
        )


def check_transform(transform: FloatArray) -> FloatArray:
    """Give a rigid 4 x 4 transform as a float64 copy.

    Raises:
        InvalidInputError: If it is not finite, not 4 x 4 or not rigid.
    """
    array = np.array(transform, dtype=np.float64)
    if array.shape != (4, 4) or not np.isfinite(array).all():
        raise InvalidInputError(f"a tool frame must be a finite 4 x 4 matrix, got {array.shape}")
    if not np.allclose(array[:3, :3] @ array[:3, :3].T, np.eye(3), atol=1e-6):
        raise InvalidInputError("a tool frame must have an orthonormal rotation part")
    return array


def interpolate_pose(start: FloatArray, end: FloatArray, progress: float) -> FloatArray:
    """Go part of the way (0..1) between two 4 x 4 poses: straight, turning about one axis."""
    result = start.copy()
    result[:3, 3] += progress * (end[:3, 3] - start[:3, 3])
    if not np.array_equal(start[:3, :3], end[:3, :3]):
        turn = Rotation.from_matrix(end[:3, :3] @ start[:3, :3].T).as_rotvec()
        result[:3, :3] = Rotation.from_rotvec(progress * turn).as_matrix() @ start[:3, :3]
    return result
