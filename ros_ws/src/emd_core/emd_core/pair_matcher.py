"""Finds messages of two kinds that belong to one moment, whatever order they come in."""

from __future__ import annotations

from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")


class PairMatcher(Generic[T]):
    """Pairs items of two kinds by their stamps; each item belongs to one pair at most.

    Attributes:
        unpaired: Items given up so far: a later pair was found, or too many waited.
    """

    def __init__(self, kinds: tuple[str, str], tolerance: float, waiting: int = 5) -> None:
        """Pair `kinds` whose stamps differ by at most `tolerance`; keep `waiting` items of each.

        Args:
            kinds: Their names, in the order in which a pair is given.
            tolerance: In the unit of the stamps.
            waiting: On a busy machine items of one kind come in bursts.
        """
        self._kinds = kinds
        self._tolerance = tolerance
        self._longest = waiting
        self._waiting: dict[str, deque[tuple[float, T]]] = {kind: deque() for kind in kinds}
        self.unpaired = 0

    @property
    def waiting(self) -> int:
        """How many items have no partner yet."""
        return sum(len(items) for items in self._waiting.values())

    def add(self, kind: str, stamp: float, item: T) -> tuple[T, T] | None:
        """Take an item; gives the pair that it completes, in the order of the kinds."""
        other = self._kinds[1 - self._kinds.index(kind)]
        for index, (partner_stamp, partner) in enumerate(self._waiting[other]):
            if abs(partner_stamp - stamp) <= self._tolerance:
                self._give_up(other, index)
                self._waiting[other].popleft()
                self._give_up(kind, len(self._waiting[kind]))
                return (item, partner) if kind == self._kinds[0] else (partner, item)
        self._waiting[kind].append((stamp, item))
        self._give_up(kind, len(self._waiting[kind]) - self._longest)
        return None

    def _give_up(self, kind: str, count: int) -> None:
        """Drop the oldest items of a kind."""
        for _ in range(count):
            self._waiting[kind].popleft()
            self.unpaired += 1
