"""Rates, latencies and losses of a stream of frames over its last seconds."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable

import numpy as np

WINDOW = 5.0  # seconds
_SAME_CLOCK = 3600.0  # seconds; older stamps are of another clock, such as a bag's


class StreamStatistics:
    """Collects what becomes of frames; threads may share it."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Take a clock in seconds; tests give their own."""
        self._clock = clock
        self._lock = threading.Lock()
        self._arrived: deque[float] = deque()
        self._served: deque[tuple[float, float, float, float]] = deque()
        self.frames = self.refused = 0

    def arrived(self) -> None:
        """Count a pair of images that came in."""
        with self._lock:
            self._arrived.append(self._clock())
            self._forget()

    def served(self, age: float, waited: float, worked: float, refused: bool) -> None:
        """Count a frame that was answered.

        Args:
            age: Seconds from its stamp to the answer, on the stamps' clock.
            waited: Seconds from its arrival until work on it began.
            worked: Seconds of work.
            refused: Whether the answer was an error.
        """
        with self._lock:
            self.frames += 1
            self.refused += refused
            self._served.append((self._clock(), age, waited, worked))
            self._forget()

    def figures(self) -> dict[str, str]:
        """Give the figures of the last seconds, and the totals, as texts for diagnostics."""
        with self._lock:
            self._forget()
            arrived, served = len(self._arrived), np.array(self._served).reshape(-1, 4)
            totals = {"frames": str(self.frames), "frames_refused": str(self.refused)}
        return {
            "rate_in_hz": f"{arrived / WINDOW:.1f}",
            "rate_out_hz": f"{len(served) / WINDOW:.1f}",
            **_percentiles("latency_ms", served[np.abs(served[:, 1]) < _SAME_CLOCK, 1]),
            **_percentiles("since_arrival_ms", served[:, 2] + served[:, 3]),
            **_percentiles("work_ms", served[:, 3]),
            **totals,
        }

    def _forget(self) -> None:
        start = self._clock() - WINDOW
        while self._arrived and self._arrived[0] < start:
            self._arrived.popleft()
        while self._served and self._served[0][0] < start:
            self._served.popleft()


def _percentiles(name: str, seconds: np.ndarray) -> dict[str, str]:
    if len(seconds) == 0:
        return {}
    middle, high, most = 1e3 * np.percentile(seconds, [50, 95, 100])
    return {name: f"{middle:.1f}", f"{name}_p95": f"{high:.1f}", f"{name}_max": f"{most:.1f}"}
