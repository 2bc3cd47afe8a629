"""A manipulation drawn on the camera's picture (paper, IV-B)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from emd_console.projection import TableProjection
from emd_core.errors import InvalidInputError
from emd_core.manipulation import Manipulation

_SHORTEST = 0.02  # metres; a shorter drag is a click
Pixel = tuple[float, float]


@dataclass
class Lesson:
    """Grasp points and the way to the release, as they are drawn.

    The hands share one displacement (paper, III-A): the first drag gives it, a click adds the
    other hand's grasp point.

    Attributes:
        grasps: Grasp points in the picture, at most two.
        release: Where the first of them is let go, or None.
    """

    grasps: list[Pixel] = field(default_factory=list)
    release: Pixel | None = None

    def drag(self, grasp: Pixel, release: Pixel) -> None:
        """Draw anew: one hand from `grasp` to `release`."""
        self.grasps, self.release = [grasp], release

    def add_hand(self, grasp: Pixel) -> None:
        """Let the other hand grasp here; a third point takes the place of the second.

        Raises:
            InvalidInputError: If nothing was dragged yet.
        """
        if self.release is None:
            raise InvalidInputError("drag from the grasp to the release first, then add a hand")
        self.grasps = [self.grasps[0], grasp]

    def clear(self) -> None:
        """Forget everything."""
        self.grasps, self.release = [], None

    def manipulation(self, projection: TableProjection) -> Manipulation:
        """Give what was drawn, in the table frame.

        Raises:
            InvalidInputError: If nothing was drawn, a point is not on the table, or the drag is
                too short to mean a motion.
        """
        if self.release is None:
            raise InvalidInputError("drag from where to grasp to where to release")
        points = projection.table_points(np.array([*self.grasps, self.release]))
        displacement = points[-1] - points[0]
        if float(np.linalg.norm(displacement)) < _SHORTEST:
            raise InvalidInputError(
                f"a drag of at least {_SHORTEST * 1000:.0f} mm on the table is wanted, got "
                f"{float(np.linalg.norm(displacement)) * 1000:.0f} mm"
            )
        grasps = np.full((2, 2), np.nan)
        grasps[: len(self.grasps)] = points[:-1]
        return Manipulation(grasps, displacement)


def pixel_from(value: Any) -> Pixel:
    """Read a point that a browser sent.

    Raises:
        InvalidInputError: If it is not two finite numbers.
    """
    numbers = isinstance(value, (list, tuple)) and len(value) == 2
    if not numbers or not all(
        isinstance(item, (int, float)) and not isinstance(item, bool) for item in value
    ):
        raise InvalidInputError(f"a point [column, row] is wanted, got {str(value)[:80]!r}")
    column, row = float(value[0]), float(value[1])
    if not np.isfinite([column, row]).all():
        raise InvalidInputError(f"a finite point [column, row] is wanted, got {value}")
    return column, row
