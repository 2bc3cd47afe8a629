"""How a part of perception is, for diagnostics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum


class Level(IntEnum):
    """As bad as it is; the numbers of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2


@dataclass(frozen=True)
class Health:
    """One part's state.

    Attributes:
        part: Its name.
        level: As bad as it is.
        text: What is wrong, and the remedy.
        values: Figures.
    """

    part: str
    level: Level
    text: str
    values: Mapping[str, str]
