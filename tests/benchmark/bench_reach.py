"""Which share of plans the arms can carry out, for each reach limit of the planner, and the price.

Goals are what random folds of the flat cloth make of it, some of them by hands that no arm could
follow. Each is planned without a reach limit, within the planner's default polygons, and within
the map of `./cell reach`; the arms' planner then tries each plan, with the torso at rest, for one
manipulation from a known cloth. A plan is unchanged if no hem or posture before the chosen one was
given up. Its error is that of the planned manipulation without a robot.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import Progress, track

from emd_arm_executor.motion_planner import MotionPlanner
from emd_arm_executor.reach_map import cached_reach_map
from emd_arm_executor.robot_description import hiro_description
from emd_arm_executor.robot_model import RobotModel
from emd_cell.bench import BenchmarkResult
from emd_cell.fold_check.random_goals import (
    flat_silhouette,
    fold_without_robot,
    random_manipulation,
    true_grid,
)
from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.config import ClothConfig
from emd_core.errors import CellError, NoPlanError
from emd_core.metrics import voxel_mse
from emd_core.reach_map import ReachMap
from emd_core.voxel_grid import VoxelGrid
from emd_planner.config import PLANNERS, ReachConfig
from emd_planner.memory import keep_freed_memory
from emd_planner.plan import plan
from emd_planner.weights import load_net

GOALS = 40
SEED = 31
MAPS = Path("runs/reach")


def run() -> BenchmarkResult:
    """Plan every goal within every limit; let the arms try the plans."""
    console = Console(stderr=True)
    keep_freed_memory()
    robot = RobotModel(hiro_description())
    with Progress(console=console) as progress:
        bar = progress.add_task("reach map", total=None)
        reach_map = cached_reach_map(
            robot, MAPS, lambda done, total: progress.update(bar, completed=done, total=total)
        )
    still = replace(robot.config, grasp=replace(robot.config.grasp, torso_turns=()))
    arms, net = MotionPlanner(robot, still), load_net()
    limits = {"none": None, "polygons": ReachConfig(), "map": reach_map}
    flat = true_grid(Cloth(ClothConfig()))
    rows: list[dict[str, Any]] = []
    for index in track(range(GOALS), "goals", console=console):
        goal = _goal(index)
        for name, limit in limits.items():
            row = _try_out(net, arms, flat, goal, limit)
            idle = voxel_mse(flat, goal)
            rows.append({"goal": index, "limit": name, "idle_mse": idle, **row})
    summary = {}
    for name in limits:
        mine = [row for row in rows if row["limit"] == name]
        for key in ("planned", "executable", "unchanged"):
            summary[f"{name}_{key}"] = float(np.mean([row[key] for row in mine]))
        done = [row for row in mine if row["voxel_mse"] is not None]
        error, idle = (np.mean([row[key] for row in done]) for key in ("voxel_mse", "idle_mse"))
        summary[f"{name}_mse_over_do_nothing"] = float(error / idle)
    config = {"goals": GOALS, "seed": SEED, "map": reach_map.identity}
    return BenchmarkResult(config, rows, summary)


def _goal(index: int) -> VoxelGrid:
    """Make what a random fold of the flat cloth leads to."""
    rng = np.random.default_rng((SEED, index))
    size = np.array(ClothConfig().side_lengths)
    while True:
        outcome = fold_without_robot(random_manipulation(rng, size))
        if outcome is not None:
            return outcome


def _try_out(
    net: Any,
    arms: MotionPlanner,
    flat: VoxelGrid,
    goal: VoxelGrid,
    limit: ReachConfig | ReachMap | None,
) -> dict[str, Any]:
    """Plan one manipulation, ask the arms, and do it without them."""
    row = {"planned": False, "executable": False, "unchanged": False, "voxel_mse": None}
    try:
        found = plan(net, flat, goal, 1, PLANNERS["ours"], limit, SEED)
    except NoPlanError:
        return row
    manipulation = found.manipulations[0]
    outcome = fold_without_robot(manipulation)
    row.update(planned=True, voxel_mse=None if outcome is None else voxel_mse(outcome, goal))
    cloth = ClothConfig()
    silhouette = flat_silhouette(np.array(cloth.side_lengths), cloth.thickness)
    try:
        motion = arms.plan_motion(manipulation, silhouette, dict(arms.robot.description.rest))
    except CellError:
        return row
    return {**row, "executable": True, "unchanged": not motion.rejected}
