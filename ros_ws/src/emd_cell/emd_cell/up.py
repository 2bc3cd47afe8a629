"""`./cell up`: the cell, running until Ctrl-C."""

from __future__ import annotations

import time
from pathlib import Path

from rich.console import Console

from emd_cell.launcher import Launcher
from emd_cell.nodes import cell_nodes
from emd_core.errors import InvalidInputError


def run_cell(
    logs: Path, gui: bool, seed: int, real_time_factor: float, only: list[str], console: Console
) -> None:
    """Start the nodes, or only the named ones, and watch them until interrupted.

    Raises:
        InvalidInputError: If a named node does not exist.
        DeadlineError: If a node is gone for good.
    """
    nodes = cell_nodes(seed, gui, True, real_time_factor)
    unknown = sorted(set(only) - {node.name for node in nodes})
    if unknown:
        raise InvalidInputError(
            f"no such node: {', '.join(unknown)}; there are {', '.join(n.name for n in nodes)}"
        )
    chosen = [node for node in nodes if not only or node.name in only]
    with Launcher(chosen, logs, console.log) as launcher:
        console.print(f"The cell is up; logs in {logs}. Ctrl-C stops it.")
        try:
            while True:
                launcher.require_alive()
                time.sleep(0.2)
        except KeyboardInterrupt:
            console.print("stopping")
