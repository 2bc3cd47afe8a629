"""What the planner's reach limit is worth: polygons beside the sampled map.

Random manipulations of `./cell check-motion` are rated by both limits, the planner's default
polygons and the reach map, and planned by the arms with the torso at rest. A manipulation is
executable if it is planned, and unchanged if no hem or posture before the chosen one was given up.
A limit is right where what it lets through is executable, and sharp where it lets through what is.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from rich.console import Console
from rich.progress import Progress, track

from emd_arm_executor.motion_planner import MotionPlanner
from emd_arm_executor.reach_map import cached_reach_map
from emd_arm_executor.robot_description import hiro_description
from emd_arm_executor.robot_model import RobotModel
from emd_cell.bench import BenchmarkResult
from emd_cell.motion_check.random_tasks import MotionTask, random_task
from emd_core.errors import CellError
from emd_core.frames import FieldOfView
from emd_planner.config import ReachConfig
from emd_planner.reach import ReachLoss

TASKS = 60
SEED = 21
# Distance from the reach that is let through, metres: a tenth of the map's step.
TOLERANCE = 0.004
MAPS = Path("runs/reach")


def run() -> BenchmarkResult:
    """Rate and plan every task."""
    console = Console(stderr=True)
    robot = RobotModel(hiro_description())
    with Progress(console=console) as progress:
        bar = progress.add_task("reach map", total=None)
        reach_map = cached_reach_map(
            robot, MAPS, lambda done, total: progress.update(bar, completed=done, total=total)
        )
    fov, cpu = FieldOfView(), torch.device("cpu")
    limits = {
        name: ReachLoss(reach, fov, cpu, may_cross=False)
        for name, reach in (("polygons", ReachConfig()), ("map", reach_map))
    }
    still = replace(robot.config, grasp=replace(robot.config.grasp, torso_turns=()))
    planner, rest = MotionPlanner(robot, still), dict(robot.description.rest)
    rows = []
    for index in track(range(TASKS), "manipulations", console=console):
        task = random_task(SEED, index)
        row = {"index": index, "kind": task.kind, **_plan(planner, task, rest)}
        for name, limit in limits.items():
            row[name] = _excess(limit, task, fov) <= TOLERANCE
        rows.append(row)
    summary = {
        "executable": _share(rows, "executable"),
        "unchanged": _share(rows, "unchanged"),
    }
    for name in limits:
        through = [row for row in rows if row[name]]
        executable = [row for row in rows if row["executable"]]
        summary[f"{name}_lets_through"] = _share(rows, name)
        summary[f"{name}_executable_of_those"] = _share(through, "executable")
        summary[f"{name}_unchanged_of_those"] = _share(through, "unchanged")
        summary[f"{name}_lets_through_of_executable"] = _share(executable, name)
    config = {"tasks": TASKS, "seed": SEED, "tolerance": TOLERANCE, "map": reach_map.identity}
    return BenchmarkResult(config, rows, summary)


def _plan(planner: MotionPlanner, task: MotionTask, rest: dict[str, float]) -> dict[str, bool]:
    try:
        plan = planner.plan_motion(task.manipulation, task.silhouette, rest)
    except CellError:
        return {"executable": False, "unchanged": False}
    return {"executable": True, "unchanged": not plan.rejected}


def _excess(limit: ReachLoss, task: MotionTask, fov: FieldOfView) -> float:
    """Give a manipulation's distance from the reach, metres."""
    manipulation = task.manipulation
    points = np.nan_to_num(manipulation.grasp_points_in_table).ravel()
    values = np.concatenate([points, manipulation.displacement_in_table]) / fov.half_extent
    used = torch.tensor(np.array(manipulation.used))
    excess = limit(torch.tensor(values, dtype=torch.float32), used)
    return float(excess) * fov.half_extent


def _share(rows: list[dict], key: str) -> float | None:
    return float(np.mean([row[key] for row in rows])) if rows else None
