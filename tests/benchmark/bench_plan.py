"""Planning time for one, two and three steps, and what the plans achieve when executed.

Tasks are neat folds from a flat cloth; plans are executed in the cloth simulation, without a
robot.
"""

import statistics

import numpy as np
import torch
from rich.console import Console
from rich.progress import track

from emd_cell.bench import BenchmarkResult
from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.manipulate import manipulate
from emd_cloth_sim.neat_folds import neat_fold
from emd_core.frames import FieldOfView
from emd_core.metrics import voxel_mse
from emd_core.voxel_grid import voxelise
from emd_planner.config import PlannerConfig
from emd_planner.plan import plan
from emd_planner.weights import load_net

TASKS = ("half", "half_left", "diagonal")
SEEDS = (0, 1)
STEPS = (1, 2, 3)


def run() -> BenchmarkResult:
    """Plan every task with every number of steps and seed; execute each plan as a whole."""
    net, rows = load_net(), []
    tasks = [(steps, name, seed) for steps in STEPS for name in TASKS for seed in SEEDS]
    results: dict[int, list[tuple[float, float, float]]] = {steps: [] for steps in STEPS}
    for steps, name, seed in track(tasks, "planning", console=Console(stderr=True)):
        results[steps].append(_task(net, name, steps, seed))
    for steps, found in results.items():
        times = [time for time, _, _ in found]
        rows.append(
            {
                "planner": "paper",
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
        "restarts": PlannerConfig().restarts,
        "max_iterations": PlannerConfig().max_iterations,
    }
    return BenchmarkResult(config, rows, {f"p50_ms_{row['steps']}": row["p50_ms"] for row in rows})


def _task(net, name: str, steps: int, seed: int) -> tuple[float, float, float]:
    """Planning time in ms, MSE after execution, MSE of doing nothing."""
    cloth = Cloth(ClothConfig())
    goal = neat_fold(name, ClothConfig()).goal_grid(FieldOfView())
    initial = voxelise(cloth.top_surface_in_table, FieldOfView())
    found = plan(net, initial, goal, steps, seed=seed)
    for manipulation in found.manipulations:
        manipulate(cloth, manipulation)
    outcome = voxelise(cloth.top_surface_in_table, FieldOfView())
    return found.planning_ms, voxel_mse(outcome, goal), voxel_mse(initial, goal)
