"""What the hands do to the cloth: one or two grasp points and one displacement (paper, III-A)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView, FloatArray


@dataclass(frozen=True)
class Manipulation:
    """Grasp the cloth at one or two points, carry it by one displacement, release it.

    The order of the two grasp points is immaterial; which arm takes which is the executor's
    choice. A point that is not used is NaN.

    Attributes:
        grasp_points_in_table: Shape (2, 2), metres, x and y in the table frame; NaN rows: unused.
        displacement_in_table: Shape (2,), metres, the same for both hands.
        grasp_directions_in_table: Unit vectors along which each hand comes to the hem, shape
            (2, 2); a NaN row, or None for both: the executor chooses.
    """

    grasp_points_in_table: FloatArray
    displacement_in_table: FloatArray
    grasp_directions_in_table: FloatArray | None = None

    def __post_init__(self) -> None:
        """Check shapes and values.

        Raises:
            InvalidInputError: If a shape is wrong, the displacement or half a point is not finite,
                or no grasp point is used, or a direction is no unit vector.
        """
        points = np.asarray(self.grasp_points_in_table, dtype=np.float64)
        displacement = np.asarray(self.displacement_in_table, dtype=np.float64)
        if points.shape != (2, 2) or displacement.shape != (2,):
            raise InvalidInputError(
                "a manipulation needs grasp points (2, 2) and a displacement (2,), got "
                f"{points.shape} and {displacement.shape}"
            )
        if not np.isfinite(displacement).all():
            raise InvalidInputError(f"the displacement must be finite, got {displacement}")
        used = np.isfinite(points).all(axis=1)
        if not np.logical_or(used, np.isnan(points).all(axis=1)).all():
            raise InvalidInputError(
                f"a grasp point must be finite, or NaN in both values when unused, got {points}"
            )
        if not used.any():
            raise InvalidInputError("at least one grasp point must be used, got none")
        object.__setattr__(self, "grasp_points_in_table", points)
        object.__setattr__(self, "displacement_in_table", displacement)
        if self.grasp_directions_in_table is not None:
            directions = checked_directions(self.grasp_directions_in_table)
            object.__setattr__(self, "grasp_directions_in_table", directions)

    @property
    def used(self) -> tuple[bool, bool]:
        """Which of the two grasp points are used."""
        points = self.grasp_points_in_table
        return bool(np.isfinite(points[0]).all()), bool(np.isfinite(points[1]).all())

    @property
    def displacements_in_table(self) -> FloatArray:
        """Displacement of each hand, shape (2, 2), metres: the same for both."""
        return np.stack([self.displacement_in_table] * 2)

    @property
    def release_points_in_table(self) -> FloatArray:
        """Where the hands let go, shape (2, 2), metres; NaN rows: unused."""
        return self.grasp_points_in_table + self.displacement_in_table

    def as_entry(self) -> dict[str, Any]:
        """Give it as JSON holds it: metres, table frame; an unused point is null."""
        points = self.grasp_points_in_table.tolist()
        used = zip(points, self.used, strict=True)
        return {
            "grasp_points": [point if is_used else None for point, is_used in used],
            "displacement": self.displacement_in_table.tolist(),
            **directions_entry(self.grasp_directions_in_table),
        }

    def to_network(self, field_of_view: FieldOfView) -> FloatArray:
        """Give the six normalised values x0 y0 x1 y1 dx dy; an unused point stays NaN."""
        values = np.concatenate([self.grasp_points_in_table.ravel(), self.displacement_in_table])
        return field_of_view.normalised_from_table(values)

    @classmethod
    def from_network(
        cls, values: FloatArray, used: tuple[bool, bool], field_of_view: FieldOfView
    ) -> Manipulation:
        """Build a manipulation from six normalised values, without the points not used."""
        in_table = field_of_view.table_from_normalised(values)
        points = in_table[:4].reshape(2, 2).copy()
        points[~np.array(used)] = np.nan
        return cls(points, in_table[4:])


def directions_entry(directions: FloatArray | None) -> dict[str, Any]:
    """Give grasp directions (2, 2) as JSON holds them; nothing if the executor may choose both."""
    if directions is None:
        return {}
    rows = directions.tolist()
    return {"grasp_directions": [None if np.isnan(row).any() else row for row in rows]}


def checked_directions(values: FloatArray) -> FloatArray:
    """Give directions, shape (2, 2), a NaN row for none.

    Raises:
        InvalidInputError: If the shape is wrong or a direction is no unit vector.
    """
    directions = np.asarray(values, dtype=np.float64)
    if directions.shape != (2, 2):
        raise InvalidInputError(f"grasp directions (2, 2) are wanted, got {directions.shape}")
    lengths = np.linalg.norm(directions, axis=1)
    free = np.isnan(directions).all(axis=1)
    if not np.isclose(lengths[~free], 1.0, atol=1e-3).all():
        raise InvalidInputError(
            "a grasp direction must be a unit vector, or NaN where the executor may choose, got "
            f"{directions.tolist()}"
        )
    return directions
