"""One sequence of states of a cloth and the manipulations between them (paper, IV-A)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView

Float32Array = NDArray[np.float32]


@dataclass(frozen=True)
class ClothSequence:
    """A sequence of L manipulations, read from a file.

    Attributes:
        index: Its number in its data set.
        packed_grids: Shape (L + 1, voxels / 8), uint8: the bits of the grids in C order.
        picks: Grasp points, shape (L, 2, 2), normalised; NaN for an unused hand.
        moves: Displacement of both hands, shape (L, 2), normalised; or one a hand, (L, 2, 2), with
            NaN for an unused one.
        states: Vertices of the mid-surface, shape (L + 1, V, 3), normalised, in half or single
            precision; None if the file lacks them.
        surface_height: How far the upper surface, which the grids show, lies above the
            mid-surface; normalised.
        field_of_view: The box that the grids cover.
    """

    index: int
    packed_grids: NDArray[np.uint8]
    picks: Float32Array
    moves: Float32Array
    states: NDArray[np.floating] | None
    surface_height: float
    field_of_view: FieldOfView

    def __post_init__(self) -> None:
        """Check the values; the shapes are those of the file's header.

        Raises:
            InvalidInputError: If a pick is half NaN or infinite, a step has no pick or no finite
                move, or a vertex is not finite.
        """
        unused = np.isnan(self.picks).any(axis=-1)
        half = unused & ~np.isnan(self.picks).all(axis=-1)
        if np.isinf(self.picks).any() or half.any():
            raise InvalidInputError("a pick must be finite, or NaN in both values")
        finite = np.isfinite(self.moves).all(axis=-1)
        moved = (finite | unused) if self.independent else finite
        if unused.all(axis=-1).any() or not moved.all():
            raise InvalidInputError("each step needs a pick and a finite move")
        if self.states is not None and not np.isfinite(self.states).all():
            raise InvalidInputError("states must be finite; make the data again")

    def __len__(self) -> int:
        """Count the manipulations."""
        return len(self.moves)

    @property
    def independent(self) -> bool:
        """Whether each hand has a displacement of its own."""
        return self.moves.ndim == 3

    @property
    def grids(self) -> NDArray[np.bool_]:
        """Occupancy, shape (L + 1, X, Y, Z)."""
        size = self.field_of_view.size
        bits = np.unpackbits(self.packed_grids, axis=-1, count=int(np.prod(size)))
        return bits.view(bool).reshape(-1, *size)

    @property
    def upper_surface(self) -> Float32Array | None:
        """Points that the grids show, shape (L + 1, V, 3), normalised; None without states."""
        if self.states is None:
            return None
        points = np.array(self.states, dtype=np.float32)
        points[..., 2] += self.surface_height
        return points
