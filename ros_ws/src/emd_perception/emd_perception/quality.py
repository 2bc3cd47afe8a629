"""How far an observation can be trusted: judgements in 0..1, multiplied."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

ALL_GOOD = "cloth found"
_WORTH_SAYING = 0.85


@dataclass(frozen=True)
class Judgement:
    """One aspect of an observation.

    Attributes:
        value: 1 if nothing speaks against the observation, 0 if it is worthless.
        complaint: What is wrong when the value is low.
    """

    value: float
    complaint: str


def good(value: float, worthless: float, perfect: float) -> float:
    """Map a measurement linearly to 0 (at `worthless`) .. 1 (at `perfect`)."""
    return float(np.clip((value - worthless) / (perfect - worthless), 0.0, 1.0))


def combine(judgements: Iterable[Judgement]) -> tuple[float, str]:
    """Multiply the judgements, and say what is wrong.

    Returns:
        Quality in 0..1 and a reason: the complaints, worst first, or "cloth found".
    """
    ranked = sorted(judgements, key=lambda judgement: judgement.value)
    quality = float(np.prod([judgement.value for judgement in ranked]))
    complaints = [one.complaint for one in ranked if one.value < _WORTH_SAYING]
    return quality, "; ".join(complaints) or ALL_GOOD
