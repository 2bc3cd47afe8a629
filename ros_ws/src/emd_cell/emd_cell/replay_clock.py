"""The stamps of a bag's images: how fast they pass, and where they jump."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from emd_core.errors import InvalidInputError

_FORWARDS, _BACKWARDS = 10.0, 1.0  # seconds between two images that are no recording's course


class ReplayClock:
    """Lets frames wait until it is their turn, and notices jumps of their stamps.

    Attributes:
        recorded: Seconds of recording that have passed, without jumps.
    """

    def __init__(
        self,
        rate: float,
        now: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Start.

        Args:
            rate: Recorded seconds a second; 0: nothing waits.
            now: Seconds; tests give their own clock.
            sleep: Waits so many seconds.

        Raises:
            InvalidInputError: If the rate is negative or not finite.
        """
        if not math.isfinite(rate) or rate < 0:
            raise InvalidInputError(
                "the rate must be 0 (as fast as possible) or recorded seconds a second, got "
                f"{rate}"
            )
        self._rate, self._now, self._sleep = rate, now, sleep
        self._start: float | None = None
        self._last: int | None = None
        self.recorded = 0.0

    def pass_to(self, stamp: int) -> float:
        """Wait until an image's time has come.

        Args:
            stamp: Nanoseconds.

        Returns:
            Seconds by which the stamps have jumped, back or forwards; 0 in the usual case.
        """
        gap = 0.0 if self._last is None else 1e-9 * (stamp - self._last)
        self._last = stamp
        jumped = not -_BACKWARDS <= gap <= _FORWARDS
        if not jumped:
            self.recorded += max(gap, 0.0)
        if self._start is None:
            self._start = self._now()
        if self._rate > 0:
            due = self._start + self.recorded / self._rate
            self._sleep(max(0.0, due - self._now()))
        return gap if jumped else 0.0
