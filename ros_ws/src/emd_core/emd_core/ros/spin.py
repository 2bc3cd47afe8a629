"""How every node of the cell starts and stops."""

from __future__ import annotations

import sys
from collections.abc import Callable

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from emd_core.errors import CellError

_SWITCH_INTERVAL = 5e-4  # seconds


def alternate_threads() -> None:
    """Let threads of this process take turns at the interpreter more often than by default.

    An executor takes it many times for each message. If it waited 5 ms each time for a thread
    that computes, messages would be handled late and in bursts, of which all but the newest
    image is dropped.
    """
    sys.setswitchinterval(_SWITCH_INTERVAL)


def spin_node(make_node: Callable[[], Node]) -> int:
    """Make a node and spin it until Ctrl-C or shutdown; returns the exit status.

    A CellError while the node is made (a wrong parameter, missing weights) is one line, status 2.
    """
    alternate_threads()
    rclpy.init()
    node = None
    try:
        node = make_node()
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except CellError as err:
        print(f"{type(err).__name__}: {err}", file=sys.stderr)
        return 2
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0
