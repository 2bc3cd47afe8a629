"""How far the jaws of a hand are open, and where its joints stand then."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray


class GripperLaw(ABC):
    """The opening law of a hand with parallel jaws."""

    @abstractmethod
    def joints_from_width(self, width: float) -> FloatArray:
        """Give the positions of the hand's joints (n,) for an opening in metres."""

    @abstractmethod
    def width_from_joints(self, angles: FloatArray) -> float:
        """Give the opening, metres, for positions of the hand's joints (n,)."""


@dataclass(frozen=True)
class SlidingFingers(GripperLaw):
    """Fingers whose joints change in proportion to the opening.

    Attributes:
        closed: Positions of the joints of closed jaws, shape (n,).
        opened: Positions at the largest opening, shape (n,).
        largest_width: That opening, metres.
    """

    closed: tuple[float, ...]
    opened: tuple[float, ...]
    largest_width: float

    def __post_init__(self) -> None:
        """Check the figures.

        Raises:
            InvalidInputError: If the numbers of joints differ, none moves, or the width is not
                positive.
        """
        if len(self.closed) != len(self.opened) or self.closed == self.opened:
            raise InvalidInputError(
                "sliding fingers need positions closed and opened of the same joints that differ, "
                f"got {self.closed} and {self.opened}"
            )
        if not self.largest_width > 0.0:
            raise InvalidInputError(f"a positive largest_width is wanted, {self.largest_width} m")

    def joints_from_width(self, width: float) -> FloatArray:
        """Give the positions of the joints (n,) for an opening in metres.

        Raises:
            InvalidInputError: If the width is out of range.
        """
        if not 0.0 <= width <= self.largest_width + 1e-9:
            raise InvalidInputError(
                f"a gripper opens from 0 to {self.largest_width:.4f} m, got {width}"
            )
        share = width / self.largest_width
        closed = np.array(self.closed)
        return np.asarray(closed + share * (np.array(self.opened) - closed))

    def width_from_joints(self, angles: FloatArray) -> float:
        """Give the opening, metres, for positions of the joints (n,)."""
        travel = np.array(self.opened) - self.closed
        return float((np.asarray(angles) - self.closed) @ travel / (travel @ travel)) * (
            self.largest_width
        )


def gripper_law(entry: Mapping[str, Any], kinds: Mapping[str, type[GripperLaw]]) -> GripperLaw:
    """Make the law that a robot's description names.

    Args:
        entry: `kind` and the figures of that kind.
        kinds: Known kinds.

    Raises:
        InvalidInputError: If the kind is unknown or its figures do not fit.
    """
    figures = {
        key: tuple(v) if isinstance(v, list) else v for key, v in entry.items() if key != "kind"
    }
    kind = kinds.get(str(entry.get("kind")))
    if kind is None:
        raise InvalidInputError(
            f"gripper_law should have a kind of {sorted(kinds)}, got {entry.get('kind')!r}"
        )
    try:
        return kind(**figures)
    except TypeError as err:
        raise InvalidInputError(f"gripper_law {entry['kind']}: {err}") from err
