"""Times the stages of a computation."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter


class Stopwatch:
    """Collects milliseconds by stage."""

    def __init__(self) -> None:
        """Start the total."""
        self._start = perf_counter()
        self._stages: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the time spent in the `with` block to a stage."""
        start = perf_counter()
        try:
            yield
        finally:
            elapsed = 1e3 * (perf_counter() - start)
            self._stages[name] = self._stages.get(name, 0.0) + elapsed

    def milliseconds(self) -> dict[str, float]:
        """Milliseconds of each stage so far, and of all under `total`."""
        return {**self._stages, "total": 1e3 * (perf_counter() - self._start)}
