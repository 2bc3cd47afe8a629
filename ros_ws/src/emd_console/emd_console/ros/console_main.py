"""The console's node: listens to the cell, and serves its pages."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Generator
from pathlib import Path
from typing import Any

import cv2
import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from emd_console.access import AccessPolicy, Tokens
from emd_console.cell_state import CellState
from emd_console.command_log import CommandLog
from emd_console.config import ConsoleConfig
from emd_console.desk import Desk
from emd_console.example_store import ExampleStore
from emd_console.history import COMMANDS, EXAMPLES
from emd_console.operator_lease import OperatorLease
from emd_console.port import require_free_port
from emd_console.ros.cell_view import CellView
from emd_console.ros.graph_cell import GraphCell
from emd_console.sections import sections
from emd_console.web.console import Console
from emd_console.web.live import LiveFeed
from emd_core.errors import CellError
from emd_core.ros.parameters import declare_config
from emd_core.ros.spin import alternate_threads

ACCESS_FILE = "access.txt"
_PAUSE = 1e-2  # seconds


def make_console(node: Node) -> Console:
    """Connect the console with the graph through `node`, which the caller spins.

    Raises:
        CellError: If a parameter is wrong or nothing can be recorded.
    """
    config = declare_config(node, ConsoleConfig())
    directory = Path(config.directory)
    state = CellState()
    view = CellView(node, state, config.reliable)
    store = ExampleStore(directory / EXAMPLES)
    desk = Desk(GraphCell(node, view), store, config.restarts)
    feed = LiveFeed(
        state,
        lambda: sections(state, desk),
        view.image,
        lambda: view.image_number,
        config.camera_rate,
    )
    log = CommandLog(directory / COMMANDS)
    policy = AccessPolicy(config.host, config.port, _tokens(config))
    console = Console(state, desk, OperatorLease(), log, store, policy, feed)
    _write_links(directory / ACCESS_FILE, console)
    return console


def _tokens(config: ConsoleConfig) -> Tokens | None:
    """Tokens that were given, or made; None if none are asked for."""
    if not config.tokens:
        return None
    made = Tokens()
    return Tokens(config.operator_token or made.operator, config.viewer_token or made.viewer)


def _write_links(path: Path, console: Console) -> None:
    """Keep the links for the owner of the file alone."""
    text = "".join(f"{role}: {link}\n" for role, link in console.links().items())
    path.unlink(missing_ok=True)
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "w") as stream:
        stream.write(text)


def serve(node: Node) -> None:
    """Spin the node in a thread and serve the pages until Ctrl-C."""
    from emd_console.web.server import make_app, make_server

    cv2.setNumThreads(1)  # for pictures of this size threads take more time than they save
    console = make_console(node)
    require_free_port(console.policy.host, console.policy.port)
    for role, link in console.links().items():
        print(f"console for the {role}: {link}", flush=True)
    spinner = GatheringExecutor()
    spinner.add_node(node)
    thread = threading.Thread(target=spin, args=(spinner,), daemon=True)
    thread.start()
    try:
        make_server(make_app(console), console.policy.host, console.policy.port).run()
    finally:
        spinner.shutdown(timeout_sec=2.0)
        thread.join(timeout=2.0)
        console.store.close()


class GatheringExecutor(SingleThreadedExecutor):
    """Lets messages gather before it looks for them.

    Getting ready to wait costs rclpy more than a message does, and what arrives together is
    taken together. Nothing that the console hears is urgent within milliseconds.
    """

    def _wait_for_ready_callbacks(self, *args: Any, **kwargs: Any) -> Generator[Any, None, None]:
        time.sleep(_PAUSE)
        yield from super()._wait_for_ready_callbacks(*args, **kwargs)


def spin(spinner: SingleThreadedExecutor) -> None:
    """Spin until the spinner or its context is shut down."""
    try:
        spinner.spin()
    except ExternalShutdownException:
        return


def main(arguments: list[str] | None = None) -> int:
    """Run the node until interrupted; status 2 for a wrong parameter.

    Args:
        arguments: As on a node's command line; the process's own if None.
    """
    alternate_threads()
    rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)  # the server has
    node = Node("console")
    try:
        serve(node)
    except KeyboardInterrupt:
        pass
    except CellError as err:
        print(f"{type(err).__name__}: {err}", file=sys.stderr)
        return 2
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
