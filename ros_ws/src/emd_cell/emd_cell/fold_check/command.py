"""`./cell check-folds`: random one-step goals through all nodes of the simulated cell."""

from __future__ import annotations

import hashlib
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import rclpy
from rich.console import Console
from rich.progress import MofNCompleteColumn, Progress, TimeElapsedColumn

from emd_arm_executor.motion_planner import MotionPlanner
from emd_arm_executor.robot_description import hiro_description
from emd_arm_executor.robot_model import RobotModel
from emd_cell.bench import machine
from emd_cell.fold_check.campaign import fold_goal
from emd_cell.fold_check.summary import summarise
from emd_cell.journal import Journal
from emd_cell.large_messages import use_large_messages
from emd_cell.launcher import Launcher
from emd_cell.nodes import cell_nodes
from emd_cell.ros.cell_client import CellClient
from emd_cloth_sim.json_file import write_json
from emd_planner.weights import SHIPPED_WEIGHTS


@dataclass(frozen=True)
class FoldCheck:
    """What is folded.

    Attributes:
        count: How many goals.
        seed: Of goals, camera noise and searches.
        real_time: Whether the simulation keeps to real time, as a real robot would; else it goes
            as fast as it can, and seconds and folds an hour are not those of the robot.
    """

    count: int
    seed: int
    real_time: bool


def check_folds(
    check: FoldCheck, folder: Path, arguments: Sequence[str], console: Console
) -> dict[str, Any]:
    """Start the cell and fold; write `summary.json` beside the journal and give it.

    Args:
        check: What is folded.
        folder: For journal, summary and the nodes' logs.
        arguments: Of the command, for the report.
        console: Shows the progress.

    Raises:
        InvalidInputError: If the folder holds another run's journal.
        CellError: If the cell does not start or a node dies; what is done is kept.
    """
    weights = hashlib.sha256(SHIPPED_WEIGHTS.read_bytes()).hexdigest()[:16]
    run = {"seed": check.seed, "weights": weights, "real_time": check.real_time}
    journal = Journal(folder / "journal.jsonl", run)
    planner = MotionPlanner(RobotModel(hiro_description()))
    columns = (*Progress.get_default_columns(), MofNCompleteColumn(), TimeElapsedColumn())
    use_large_messages()
    nodes = cell_nodes(check.seed, overview=False, real_time_factor=float(check.real_time))
    with (
        Progress(*columns, console=console) as progress,
        Launcher(nodes, folder / "logs", console.log) as launcher,
    ):
        bar = progress.add_task("folds", total=check.count, completed=len(journal.records))
        rclpy.init()
        client = CellClient(on_spin=launcher.require_alive)
        try:
            client.wait_for_cell(simulated=True)
            for index in range(len(journal.records), check.count):
                journal.append(fold_goal(client, planner, check.seed, index))
                progress.update(bar, completed=len(journal.records))
        finally:
            client.destroy_node()
            rclpy.try_shutdown()
    report: dict[str, Any] = {
        "command": shlex.join(["./cell", "check-folds", *arguments]),
        "machine": machine(),
        "config": run,
        "summary": summarise(journal.records[: check.count]),
    }
    write_json(folder / "summary.json", report)
    return report
