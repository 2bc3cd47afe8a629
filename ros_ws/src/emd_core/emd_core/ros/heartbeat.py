"""A node says on /diagnostics that it lives and what it does."""

from __future__ import annotations

from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node

PERIOD = 1.0


class Heartbeat:
    """Publishes one status a second of the wall clock, also while simulated time stands still."""

    def __init__(self, node: Node, part: str, doing: Callable[[], str | None]) -> None:
        """Begin to report.

        Args:
            node: Who reports.
            part: What of it is reported on; the status is named `<node>: <part>`.
            doing: What is under way, such as "planning"; None while it waits.
        """
        self._node = node
        self._part = part
        self._doing = doing
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._timer = node.create_timer(
            PERIOD, self.beat, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def beat(self) -> None:
        """Publish the present status."""
        status = DiagnosticStatus(
            level=DiagnosticStatus.OK,
            name=f"{self._node.get_name()}: {self._part}",
            message=self._doing() or "ready",
            hardware_id=self._node.get_fully_qualified_name(),
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)
