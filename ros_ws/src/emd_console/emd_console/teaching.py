"""A manipulation drawn on the camera's picture (paper, IV-B)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from emd_console.cell_port import Check
from emd_console.projection import TableProjection
from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray
from emd_core.manipulation import Manipulation

_SHORTEST = 0.02  # metres; a shorter drag is a click, a shorter handle no direction
Pixel = tuple[float, float]
Grip = tuple[FloatArray, FloatArray]  # a point at the hem and the direction of the hand, (2,)


@dataclass
class Lesson:
    """Grasp points and the way to the release, as they are drawn.

    The hands share one displacement (paper, III-A): the first drag gives it, a click adds the
    other hand's grasp point.

    Attributes:
        grasps: Grasp points in the picture, at most two.
        release: Where the first of them is let go, or None.
        directions: Along which each hand shall come to its hem, unit vectors in the table frame,
            shape (2,); None: the executor chooses.
        check: What the executor says of it, until it is changed.
        refusal: Why the executor cannot do it.
    """

    grasps: list[Pixel] = field(default_factory=list)
    release: Pixel | None = None
    directions: list[FloatArray | None] = field(default_factory=list)
    check: Check | None = None
    refusal: str = ""

    def drag(self, grasp: Pixel, release: Pixel) -> None:
        """Draw anew: one hand from `grasp` to `release`."""
        self._draw([grasp], release, [None])

    def add_hand(self, grasp: Pixel) -> None:
        """Let the other hand grasp here; a third point takes the place of the second.

        Raises:
            InvalidInputError: If nothing was dragged yet.
        """
        if self.release is None:
            raise InvalidInputError("drag from the grasp to the release first, then add a hand")
        self._draw([self.grasps[0], grasp], self.release, [self.directions[0], None])

    def grips(self, projection: TableProjection) -> list[Grip | None]:
        """Where each drawn hand grips and whence it comes; None where nobody has said so yet."""
        if self.check is not None:
            held = self.check.executed.grasp_points_in_table[np.array(self.check.executed.used)]
            return list(zip(held, self.check.directions, strict=True))
        return [
            None if way is None else (projection.table_points(np.array([pixel]))[0], way)
            for pixel, way in zip(self.grasps, self.directions, strict=True)
        ]

    def turn(self, hand: int, handle: Pixel, projection: TableProjection) -> None:
        """Let a hand come from where its handle is drawn.

        Raises:
            InvalidInputError: If the hand is not drawn, or the handle is not on the table or at
                the hem itself.
        """
        point, _ = self._grip(hand, projection)
        direction = point - projection.table_points(np.array([handle]))[0]
        length = float(np.linalg.norm(direction))
        if length < _SHORTEST:
            raise InvalidInputError("draw the handle farther away from the hem")
        self._ask(hand, direction / length)

    def turn_by(self, hand: int, angle: float, projection: TableProjection) -> None:
        """Turn the direction of a hand; counterclockwise as seen from above, radians.

        Raises:
            InvalidInputError: If the hand is not drawn.
        """
        _, direction = self._grip(hand, projection)
        cosine, sine = np.cos(angle), np.sin(angle)
        self._ask(hand, np.array([[cosine, -sine], [sine, cosine]]) @ direction)

    def free(self, hand: int) -> None:
        """Let the executor choose again whence a hand comes."""
        if hand < len(self.directions):
            self._ask(hand, None)

    def clear(self) -> None:
        """Forget everything."""
        self._draw([], None, [])

    def _draw(
        self,
        grasps: list[Pixel],
        release: Pixel | None,
        directions: list[FloatArray | None],
    ) -> None:
        """Change the drawing; what was said of it counts no longer."""
        self.grasps, self.release, self.directions = grasps, release, directions
        self.check, self.refusal = None, ""

    def _ask(self, hand: int, direction: FloatArray | None) -> None:
        asked = list(self.directions)
        asked[hand] = direction
        self._draw(self.grasps, self.release, asked)

    def _grip(self, hand: int, projection: TableProjection) -> Grip:
        grips = self.grips(projection)
        grip = grips[hand] if 0 <= hand < len(grips) else None
        if grip is None:
            raise InvalidInputError("draw a manipulation first, then turn a hand")
        return grip

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
        return Manipulation(grasps, displacement, self._asked_directions())

    def _asked_directions(self) -> FloatArray | None:
        """Shape (2, 2), NaN rows where the executor may choose; None if it may everywhere."""
        if all(direction is None for direction in self.directions):
            return None
        rows = np.full((2, 2), np.nan)
        for row, direction in zip(rows, self.directions, strict=False):
            row[:] = np.nan if direction is None else direction
        return rows


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


def points_from(arguments: Any) -> list[Pixel]:
    """Read the points of an event that a browser sent.

    Raises:
        InvalidInputError: If they are no list of points.
    """
    points = arguments.get("points") if isinstance(arguments, dict) else None
    if not isinstance(points, list):
        raise InvalidInputError("a list of points is wanted")
    return [pixel_from(point) for point in points]
