"""`./cell check-motion`: random manipulations through the arms' planner, all audited."""

from __future__ import annotations

import hashlib
import shlex
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import MofNCompleteColumn, Progress, TimeElapsedColumn

import emd_arm_executor
from emd_arm_executor.robot_description import hiro_description, load_description
from emd_cell.bench import machine
from emd_cell.motion_check.campaign import Campaign, run_campaign, summarise
from emd_cloth_sim.json_file import write_json


def check_motion(
    campaign_count: int,
    seed: int,
    folder: Path,
    robot_file: Path | None,
    minutes: float,
    workers: int,
    arguments: Sequence[str],
    console: Console,
) -> dict[str, Any]:
    """Run or go on with a campaign; write `summary.json` beside its journal and give it.

    Raises:
        InvalidInputError: If the folder holds another campaign's journal, or the robot's file is
            unusable.
    """
    description = hiro_description() if robot_file is None else load_description(robot_file)
    campaign = Campaign(campaign_count, seed, identity(robot_file))
    deadline = time.monotonic() + 60.0 * minutes
    columns = (*Progress.get_default_columns(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console) as progress:
        bar = progress.add_task("manipulations", total=campaign.count)
        records = run_campaign(
            description,
            campaign,
            folder / "journal.jsonl",
            lambda done: progress.update(bar, completed=done),
            (lambda: time.monotonic() > deadline) if minutes > 0.0 else None,
            workers,
        )
    report: dict[str, Any] = {
        "command": shlex.join(["./cell", "check-motion", *arguments]),
        "machine": machine(),
        "config": {"seed": seed, "wanted": campaign.count, "identity": campaign.identity},
        "summary": summarise(records),
    }
    write_json(folder / "summary.json", report)
    return report


def identity(robot_file: Path | None) -> str:
    """Digest of the sources and robots that plan motions, and of the robot's file if named.

    Of the executor's sources those count that the campaign has imported.
    """
    digest = hashlib.sha256()
    package = emd_arm_executor.__name__
    modules = [m for name, m in sorted(sys.modules.items()) if name.split(".")[0] == package]
    sources = [Path(module.__file__) for module in modules if module.__file__]
    for kind in ("*/*.yaml", "*/*.urdf"):
        sources += sorted(Path(emd_arm_executor.__file__).parent.glob(kind))
    for path in (*sources, *([robot_file] if robot_file else [])):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
