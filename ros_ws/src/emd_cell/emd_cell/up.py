"""`./cell up`: the cell, running until Ctrl-C."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from emd_cell.large_messages import use_large_messages
from emd_cell.launcher import Launcher, NodeSpec
from emd_cell.nodes import CONSOLE, cell_nodes, console_node
from emd_console.access import is_loopback
from emd_console.port import free_port
from emd_core.errors import InvalidInputError


@dataclass(frozen=True)
class UpOptions:
    """What to start.

    Attributes:
        logs: Directory of the nodes' logs.
        gui: Whether the simulator opens its window.
        seed: Of the camera's noise.
        real_time_factor: Simulated seconds a second at most; 0: as fast as possible.
        only: Names of the nodes to start; all if empty.
        listen: Address of the console; beyond this machine it asks for tokens.
        port: Its port, or the next free one; 0: no console.
    """

    logs: Path = Path("runs/up")
    gui: bool = False
    seed: int = 0
    real_time_factor: float = 1.0
    only: tuple[str, ...] = ()
    listen: str = "127.0.0.1"
    port: int = 8765


def run_cell(options: UpOptions, console: Console) -> None:
    """Start the nodes, or only the named ones, and watch them until interrupted.

    Raises:
        InvalidInputError: If a named node does not exist.
        DeadlineError: If a node is gone for good.
    """
    nodes = cell_nodes(options.seed, options.gui, True, options.real_time_factor)
    port = free_port(options.listen, options.port) if options.port else 0
    if port:
        nodes.append(console_node(options.listen, port, not is_loopback(options.listen)))
    chosen = _chosen(nodes, options.only)
    use_large_messages()
    with Launcher(chosen, options.logs, console.log) as launcher:
        console.print(f"The cell is up; logs in {options.logs}. Ctrl-C stops it.")
        if any(node.name == CONSOLE for node in chosen):
            console.print(_console_text(options, port), highlight=False, soft_wrap=True)
        try:
            while True:
                launcher.require_alive()
                time.sleep(0.2)
        except KeyboardInterrupt:
            console.print("stopping")


def _chosen(nodes: list[NodeSpec], only: tuple[str, ...]) -> list[NodeSpec]:
    unknown = sorted(set(only) - {node.name for node in nodes})
    if unknown:
        raise InvalidInputError(
            f"no such node: {', '.join(unknown)}; there are {', '.join(n.name for n in nodes)}"
        )
    return [node for node in nodes if not only or node.name in only]


def _console_text(options: UpOptions, port: int) -> str:
    """Where the console is; its tokens stand in its log and in a file of its owner's alone."""
    if is_loopback(options.listen):
        return f"The console: http://{options.listen}:{port}/"
    return f"The console listens on {options.listen}:{port}; links in runs/console/access.txt"
