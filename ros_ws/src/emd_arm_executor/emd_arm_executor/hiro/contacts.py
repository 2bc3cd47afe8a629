"""Which links may touch which, and what a touch is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

TABLE = "table"
FLOOR = "floor"

# Links that never leave each other's neighbourhood and whose simplified shapes overlap: an arm's
# own links, and the shoulders with the body. Kept apart are arm and arm, and an arm's outer links
# and hand from body, head and camera.
_SHOULDER = ("ARM_JOINT0_Link", "ARM_JOINT1_Link")


@dataclass(frozen=True)
class Contact:
    """Two bodies that touch.

    Attributes:
        link_a: A robot link.
        link_b: Another robot link, `TABLE` or `FLOOR`.
        depth: How far they overlap, metres, >= 0.
        position_in_waist: A point of the contact, metres.
    """

    link_a: str
    link_b: str
    depth: float
    position_in_waist: tuple[float, float, float]

    @property
    def is_arm_to_arm(self) -> bool:
        """Whether the left arm or hand touches the right one."""
        return {side_of(self.link_a), side_of(self.link_b)} == {"left", "right"}


def side_of(link: str) -> str:
    """Say which arm a link belongs to: "left", "right", or "" for body, head and table."""
    if link.startswith(("LARM", "LHAND", "left_")):
        return "left"
    if link.startswith(("RARM", "RHAND", "right_")):
        return "right"
    return ""


def watched_pairs(links: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Give the pairs of robot links that must not touch."""
    for link_a, link_b in combinations(links, 2):
        side_a, side_b = side_of(link_a), side_of(link_b)
        if side_a == side_b:
            continue
        if side_a and side_b:
            yield link_a, link_b
        elif not (link_a if side_a else link_b).endswith(_SHOULDER):
            yield link_a, link_b
