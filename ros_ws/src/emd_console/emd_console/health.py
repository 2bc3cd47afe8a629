"""What the nodes say of themselves, and what their silence means, in plain words."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

# Seconds after which a node that reports once a second, or with every frame, counts as silent.
SILENT_AFTER = 5.0

# The nodes of a cell, and what goes missing without them.
EXPECTED: Mapping[str, str] = {
    "perception": "the cloth is not seen",
    "planner": "nothing can be planned",
    "arm_executor": "the arms cannot move",
}
_LEVELS = ("ok", "warning", "error", "silent")


@dataclass(frozen=True)
class Report:
    """One status that came on /diagnostics.

    Attributes:
        node: Name of the node, without its namespace.
        part: What of it is reported on.
        level: ok, warning, error or silent.
        text: What it says.
        received: Monotonic seconds of its arrival.
    """

    node: str
    part: str
    level: str
    text: str
    received: float


@dataclass(frozen=True)
class NodeHealth:
    """How a node is.

    Attributes:
        node: Its name.
        level: ok, warning, error or silent.
        text: A sentence for the operator.
    """

    node: str
    level: str
    text: str


def report_from_status(name: str, level: int, text: str, node: str, received: float) -> Report:
    """Read one status.

    Args:
        name: `<node>: <part>`, as diagnostics are named.
        level: 0 ok, 1 warning, 2 error, 3 stale (diagnostic_msgs/DiagnosticStatus).
        text: Its message.
        node: Its hardware_id, the node's full name; the one in `name` if empty.
        received: Monotonic seconds.
    """
    prefix, _, part = name.partition(": ")
    short = (node or prefix).rstrip("/").rpartition("/")[2] or prefix
    return Report(short, part or prefix, _LEVELS[min(max(level, 0), 3)], text, received)


def node_health(reports: Iterable[Report], now: float) -> list[NodeHealth]:
    """Say how every node is that is needed or has ever reported.

    Args:
        reports: The last report of each part of each node.
        now: Monotonic seconds.
    """
    by_node: dict[str, list[Report]] = {}
    for report in reports:
        by_node.setdefault(report.node, []).append(report)
    names = [*EXPECTED, *sorted(set(by_node) - set(EXPECTED))]
    return [_health(name, by_node.get(name, []), now) for name in names]


def _health(name: str, reports: list[Report], now: float) -> NodeHealth:
    """A node is as bad as its worst part, and silent when all its parts are."""
    lacking = EXPECTED.get(name, "what it does is missing")
    if not reports:
        text = f"not heard of yet: {lacking}. Is the cell running? (./cell up)"
        return NodeHealth(name, "silent", text)
    last = max(report.received for report in reports)
    if now - last > SILENT_AFTER:
        text = f"silent for {now - last:.0f} s: {lacking}. It may have died; its log tells why."
        return NodeHealth(name, "silent", text)
    fresh = (report for report in reports if now - report.received <= SILENT_AFTER)
    worst = max(fresh, key=lambda report: (_LEVELS.index(report.level), report.received))
    return NodeHealth(name, worst.level, worst.text)
