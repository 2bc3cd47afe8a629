"""`./cell demo`: the whole chain of the paper on a simulated HIRO."""

from __future__ import annotations

import shlex
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import rclpy
from rich.console import Console

from emd_cell.goals import Goal, load_goal
from emd_cell.large_messages import use_large_messages
from emd_cell.launcher import Launcher
from emd_cell.nodes import cell_nodes, recorder_node
from emd_cell.report import DemoReport, StripColumn, error_entry, write_gif, write_strip
from emd_cell.ros.cell_client import CellClient
from emd_cell.ros.folding_loop import FoldingConfig, FoldingLoop
from emd_core.errors import CellError, InvalidInputError


@dataclass(frozen=True)
class DemoOptions:
    """What to demonstrate.

    Attributes:
        goal: Name of a neat fold, or the path of a voxel grid (.npz).
        out: Directory for report and pictures.
        steps: Manipulations to plan; 0: as many as the neat fold needs.
        seed: Of the camera's noise and the planner.
        record: Directory of a bag to record, or None.
        gui: Whether to open the simulator's window.
        real_time_factor: Simulated seconds a second at most; 0: as fast as possible.
    """

    goal: str = "half"
    out: Path = Path("runs/demo")
    steps: int = 0
    seed: int = 0
    record: Path | None = None
    gui: bool = False
    real_time_factor: float = 1.0


def run_demo(options: DemoOptions, console: Console) -> DemoReport:
    """Start the cell, fold, write report.json, strip.png and fold.gif; never raises a CellError.

    Raises:
        InvalidInputError: If the goal or the bag's directory cannot be used; nothing was started.
    """
    goal = load_goal(options.goal)
    if options.record is not None and options.record.exists():
        raise InvalidInputError(f"{options.record} exists already; name another bag to record")
    options.out.mkdir(parents=True, exist_ok=True)
    report = DemoReport(options.goal, options.seed, shlex.join(["./cell", *sys.argv[1:]]))
    config = FoldingConfig(steps=options.steps or goal.steps, seed=options.seed)
    use_large_messages()
    started = time.monotonic()
    with console.status("starting the cell") as status:
        nodes = cell_nodes(options.seed, options.gui, True, options.real_time_factor)
        if options.record is not None:
            nodes.append(recorder_node(options.record))
        with Launcher(nodes, options.out / "logs", console.log) as launcher:
            _fold(launcher, goal, config, report, options.out, status.update)
    report.seconds = time.monotonic() - started
    report.write(options.out / "report.json")
    return report


def _fold(
    launcher: Launcher,
    goal: Goal,
    config: FoldingConfig,
    report: DemoReport,
    out: Path,
    on_phase: Callable[[str], None],
) -> None:
    rclpy.init()
    client = CellClient(on_spin=launcher.require_alive)
    loop = FoldingLoop(client, goal.grid, config, report, on_phase)
    try:
        client.wait_for_cell(simulated=True)
        loop.run()
    except CellError as err:
        report.error = error_entry(err)
    finally:
        columns = [*loop.trace.columns, StripColumn("goal", goal.grid)]
        on_phase("writing pictures")
        write_strip(out / "strip.png", columns)
        if client.overview_frames:
            write_gif(out / "fold.gif", client.overview_frames)
        client.destroy_node()
        rclpy.try_shutdown()
