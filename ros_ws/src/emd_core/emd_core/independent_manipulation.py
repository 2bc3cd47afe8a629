"""Manipulations in which each hand goes a way of its own.

The paper's hands share one displacement, and what plans a `emd_core.manipulation.Manipulation`
relies on that. So this is a type of its own, which the simulation and the arms take: a planner
cannot be given it by mistake and drop a displacement.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView, FloatArray
from emd_core.manipulation import Manipulation, checked_directions, directions_entry


@dataclass(frozen=True)
class IndependentManipulation:
    """Grasp the cloth at one or two points, carry each by its own displacement, release both.

    Attributes:
        grasp_points_in_table: Shape (2, 2), metres, x and y in the table frame; NaN rows: unused.
        displacements_in_table: Shape (2, 2), metres, one row a hand; NaN rows: unused.
        grasp_directions_in_table: See `Manipulation`.
    """

    grasp_points_in_table: FloatArray
    displacements_in_table: FloatArray
    grasp_directions_in_table: FloatArray | None = None

    def __post_init__(self) -> None:
        """Check shapes and values.

        Raises:
            InvalidInputError: If a shape is wrong, a row is neither finite nor NaN, the two do not
                use the same hands, no hand is used, or a direction is no unit vector.
        """
        rows = []
        for name in ("grasp_points_in_table", "displacements_in_table"):
            values = np.asarray(getattr(self, name), dtype=np.float64)
            if values.shape != (2, 2):
                raise InvalidInputError(f"{name} must have shape (2, 2), got {values.shape}")
            finite = np.isfinite(values).all(axis=1)
            if not (finite | np.isnan(values).all(axis=1)).all():
                raise InvalidInputError(f"each row of {name} must be finite or NaN, got {values}")
            object.__setattr__(self, name, values)
            rows.append(finite)
        if (rows[0] != rows[1]).any() or not rows[0].any():
            raise InvalidInputError(
                "at least one hand must be used, with a grasp point and a displacement, got "
                f"points for {rows[0]} and displacements for {rows[1]}"
            )
        if self.grasp_directions_in_table is not None:
            directions = checked_directions(self.grasp_directions_in_table)
            object.__setattr__(self, "grasp_directions_in_table", directions)

    @property
    def used(self) -> tuple[bool, bool]:
        """Which hands are used."""
        points = self.grasp_points_in_table
        return bool(np.isfinite(points[0]).all()), bool(np.isfinite(points[1]).all())

    def as_entry(self) -> dict[str, Any]:
        """Give it as JSON holds it: metres, table frame; what is not used is null."""
        rows = zip(self.used, self.grasp_points_in_table, self.displacements_in_table, strict=True)
        points, moves = zip(
            *[(p.tolist(), d.tolist()) if used else (None, None) for used, p, d in rows],
            strict=True,
        )
        return {
            "grasp_points": list(points),
            "displacements": list(moves),
            **directions_entry(self.grasp_directions_in_table),
        }

    def normalised(self, field_of_view: FieldOfView) -> tuple[FloatArray, FloatArray]:
        """Give grasp points and displacements, both (2, 2), in normalised units."""
        return (
            field_of_view.normalised_from_table(self.grasp_points_in_table),
            field_of_view.normalised_from_table(self.displacements_in_table),
        )


# What the hands of a simulation or a robot can do.
HandsManipulation = Manipulation | IndependentManipulation
