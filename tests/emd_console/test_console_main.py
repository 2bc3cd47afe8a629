"""How the console's node spins beside its server."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from own_domain import own_context
from rclpy.node import Node
from std_msgs.msg import Int32

from emd_console.ros.console_main import GatheringExecutor, spin

COUNT = 40


def test_all_that_gathers_is_taken_and_the_end_is_heard() -> None:
    """A burst on two topics arrives whole and in order; shutting down ends the thread."""
    with own_context() as context:
        node, other = (Node(name, context=context) for name in ("console", "cell"))
        heard: dict[str, list[int]] = {"a": [], "b": []}
        for topic, values in heard.items():
            node.create_subscription(Int32, topic, lambda m, v=values: v.append(m.data), COUNT)
        publishers = [other.create_publisher(Int32, topic, COUNT) for topic in heard]
        spinner = GatheringExecutor(context=context)
        spinner.add_node(node)
        thread = threading.Thread(target=spin, args=(spinner,))
        thread.start()
        _wait(lambda: all(publisher.get_subscription_count() for publisher in publishers))
        for value in range(COUNT):
            for publisher in publishers:
                publisher.publish(Int32(data=value))
        _wait(lambda: all(len(values) == COUNT for values in heard.values()))
        assert all(values == list(range(COUNT)) for values in heard.values())
        spinner.shutdown(timeout_sec=10.0)
        thread.join(10.0)
        assert not thread.is_alive()
        node.destroy_node()
        other.destroy_node()


def _wait(holds: Callable[[], bool]) -> None:
    end = time.monotonic() + 20.0
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.01)
