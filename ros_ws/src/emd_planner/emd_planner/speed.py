"""How fast training runs, beside what its device can multiply."""

from __future__ import annotations

import time
from collections.abc import Callable

import torch
from torch.utils.flop_counter import FlopCounterMode

_SIDES = {"cpu": 1024, "cuda": 8192}
_ROUNDS = 5


def count_operations(work: Callable[[], None]) -> int:
    """Do some work and count the floating-point operations of its products and convolutions."""
    with FlopCounterMode(display=False) as counter:
        work()
    return int(counter.get_total_flops())


def measure_peak(device: torch.device, kind: torch.dtype) -> float:
    """Measure the operations a second of a large matrix product, the best of a few.

    Args:
        device: On which threads or GPU.
        kind: Of the matrices' numbers.
    """
    side = _SIDES[device.type]
    one, other = (torch.ones((side, side), dtype=kind, device=device) for _ in range(2))
    best = float("inf")
    for _ in range(_ROUNDS):
        if device.type == "cuda":
            torch.cuda.synchronize(device)
        begin = time.perf_counter()
        product = one @ other
        if device.type == "cuda":
            torch.cuda.synchronize(device)
        best = min(best, time.perf_counter() - begin)
        del product
    return 2.0 * side**3 / best


class SpeedMeter:
    """Speed of a training run since it was last asked for."""

    def __init__(self, device: torch.device, kind: torch.dtype) -> None:
        """Measure what the device can do."""
        self._peak = measure_peak(device, kind)
        self._operations = 0
        self._steps, self._seconds = 0, 0.0

    @property
    def knows_work(self) -> bool:
        """Whether the operations of a step have been counted."""
        return self._operations > 0

    def set_work(self, operations: int) -> None:
        """Tell the operations of one step."""
        self._operations = operations

    def note(self, seconds: float) -> None:
        """Note a step that took so long."""
        self._steps += 1
        self._seconds += seconds

    def take(self) -> tuple[float, float]:
        """Give steps a second and the share of the device's peak since the last call."""
        rate = self._steps / max(self._seconds, 1e-9)
        self._steps, self._seconds = 0, 0.0
        return rate, rate * self._operations / self._peak
