"""Planning time for one, two and three steps, and what the plans achieve when executed.

The planners stand side by side: each task is planned by all of them in turn, with one net.
Tasks are neat folds from a flat cloth. Plans are executed as a whole in the cloth simulation,
without a robot, but gripped where the executor would grip: at the hem nearest to each planned
point, with the displacement that keeps the planned crease. Without a hem near enough a step does
nothing.
"""

import math
import statistics
from contextlib import suppress
from dataclasses import asdict

import numpy as np
import torch
from rich.console import Console
from rich.progress import track

from emd_arm_executor.grasp import displacement_keeping_crease, grasp_poses
from emd_arm_executor.hem import find_hems
from emd_arm_executor.observed_silhouette import silhouette_from_points
from emd_cell.bench import BenchmarkResult
from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.manipulate import manipulate
from emd_cloth_sim.neat_folds import neat_fold
from emd_core.errors import NoHemError
from emd_core.frames import FieldOfView
from emd_core.manipulation import Manipulation
from emd_core.metrics import voxel_mse
from emd_core.voxel_grid import voxelise
from emd_planner.config import PLANNERS, PlannerConfig, ReachConfig
from emd_planner.memory import keep_freed_memory
from emd_planner.plan import plan
from emd_planner.weights import load_net

TASKS = ("half", "half_left", "diagonal")
SEEDS = (0, 1)
STEPS = (1, 2, 3)


def run() -> BenchmarkResult:
    """Plan every task with every planner, number of steps and seed; execute the plans."""
    keep_freed_memory()
    net, rows = load_net(), []
    _task(net, PLANNERS["ours"], TASKS[0], 1, 0)  # what is done once only
    tasks = [(steps, name, seed) for steps in STEPS for name in TASKS for seed in SEEDS]
    results: dict[tuple[str, int], list[tuple[float, float, float]]] = {
        (planner, steps): [] for steps in STEPS for planner in PLANNERS
    }
    for steps, name, seed in track(tasks, "planning", console=Console(stderr=True)):
        for planner, config in PLANNERS.items():
            results[planner, steps].append(_task(net, config, name, steps, seed))
    for (planner, steps), found in results.items():
        times = [time for time, _, _ in found]
        rows.append(
            {
                "planner": planner,
                "steps": steps,
                "p50_ms": statistics.median(times),
                "p95_ms": float(np.percentile(times, 95)),
                "executed_mse": statistics.mean(mse for _, mse, _ in found),
                "do_nothing_mse": statistics.mean(mse for _, _, mse in found),
                "plans": len(found),
            }
        )
    config = {
        "tasks": TASKS,
        "seeds": SEEDS,
        "threads": torch.get_num_threads(),
        "planners": {name: _finite(asdict(config)) for name, config in PLANNERS.items()},
    }
    times = {(row["planner"], row["steps"]): row["p50_ms"] for row in rows}
    ratios = {
        f"paper_over_ours_{steps}": times["paper", steps] / times["ours", steps] for steps in STEPS
    }
    return BenchmarkResult(config, rows, ratios)


def _finite(settings: dict) -> dict:
    """Leave out what JSON cannot hold: a time budget that is not limited."""
    return {name: value for name, value in settings.items() if value != math.inf}


def _task(
    net, config: PlannerConfig, name: str, steps: int, seed: int
) -> tuple[float, float, float]:
    """Planning time in ms, MSE after execution, MSE of doing nothing."""
    cloth = Cloth(ClothConfig())
    goal = neat_fold(name, ClothConfig()).goal_grid(FieldOfView())
    initial = voxelise(cloth.top_surface_in_table, FieldOfView())
    found = plan(net, initial, goal, steps, config, ReachConfig(), seed)
    for manipulation in found.manipulations:
        with suppress(NoHemError):
            manipulate(cloth, _gripped_at_the_hem(cloth, manipulation))
    outcome = voxelise(cloth.top_surface_in_table, FieldOfView())
    return found.planning_ms, voxel_mse(outcome, goal), voxel_mse(initial, goal)


def _gripped_at_the_hem(cloth: Cloth, planned: Manipulation) -> Manipulation:
    """Move the grasp points as the executor does when the first posture is possible."""
    silhouette = silhouette_from_points(cloth.top_surface_in_table)
    points = planned.grasp_points_in_table[np.array(planned.used)]
    grasps = [next(grasp_poses(find_hems(silhouette, point, 1)[0])) for point in points]
    held = np.full((2, 2), np.nan)
    held[: len(grasps)] = [grasp.held_point_in_table for grasp in grasps]
    displacement = displacement_keeping_crease(planned.displacement_in_table, points, grasps)
    return Manipulation(held, displacement)
