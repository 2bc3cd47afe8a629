"""Ranges of settings, stated once beside their defaults."""

from __future__ import annotations

import math
from dataclasses import Field, dataclass, field, fields
from typing import Any

from emd_core.errors import InvalidInputError

_KEY = "range"


@dataclass(frozen=True)
class ValueRange:
    """A closed interval."""

    low: float
    high: float

    def holds(self, value: float) -> bool:
        """Whether a finite value lies in it."""
        return math.isfinite(value) and self.low <= value <= self.high


def bounded(default: Any, low: float, high: float) -> Any:
    """Make a dataclass field with a default and the range of its values, both ends included."""
    return field(default=default, metadata={_KEY: ValueRange(low, high)})


def range_of(setting: Field[Any]) -> ValueRange | None:
    """Give the range of a field that `bounded` made."""
    return setting.metadata.get(_KEY)


def check_ranges(config: Any) -> None:
    """Check every bounded field of a dataclass.

    Raises:
        InvalidInputError: If a value is out of its range or not finite.
    """
    for setting in fields(config):
        allowed, value = range_of(setting), getattr(config, setting.name)
        if allowed is not None and not allowed.holds(value):
            raise InvalidInputError(
                f"{type(config).__name__}.{setting.name} must be in {allowed.low:g}.."
                f"{allowed.high:g}, got {value}"
            )
