"""How far half folds drag the layer that stays: the arc beside the plain path up, across, down.

A simulated HIRO folds a simulated towel of 0.40 m in half, bringing the far hem over the near one,
both hands, with either shape of the carrying path (`path.lift_shape`). The near hem, which nobody
grasps, should stay: its vertices' shifts from before the grasp to after the release are measured,
at their largest while the hands move and in the end. That the cloth did fold is told by the shift
of the grasped hem.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from rich.console import Console

from emd_arm_executor.config import MotionConfig
from emd_arm_executor.executor import MotionExecutor
from emd_arm_executor.hiro.cell_simulation import CellSimulation
from emd_arm_executor.hiro.simulated_robot import SimulatedRobot
from emd_arm_executor.hiro.world import HiroWorld
from emd_arm_executor.motion_planner import MotionPlanner
from emd_arm_executor.observed_silhouette import silhouette_from_points
from emd_arm_executor.robot_description import hiro_description
from emd_arm_executor.robot_model import RobotModel
from emd_cell.bench import BenchmarkResult
from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.config import ClothConfig
from emd_core.manipulation import Manipulation

SHAPES = ("arc", "vertical")
FOLD = Manipulation(np.array([[-0.195, -0.17], [-0.195, 0.17]]), np.array([0.39, 0.0]))


def run() -> BenchmarkResult:
    """Fold once with each shape."""
    console = Console(stderr=True)
    rows = []
    for shape in SHAPES:
        console.print(f"folding with the path '{shape}'")
        rows.append(_fold(shape))
    drifts = {f"{row['shape']}_drift_mm": row["largest_while_moving_mm"] for row in rows}
    config = {"cloth": "ClothConfig()", "displacement": FOLD.displacement_in_table.tolist()}
    return BenchmarkResult(config, rows, drifts)


def _fold(shape: str) -> dict:
    config = MotionConfig()
    config = replace(config, path=replace(config.path, lift_shape=shape))
    robot = RobotModel(hiro_description(), config)
    cloth = Cloth(ClothConfig())
    start = cloth.positions_in_table.copy()
    near = start[:, 0] > start[:, 0].max() - 1e-6
    far = start[:, 0] < start[:, 0].min() + 1e-6
    lower = start[:, 0] > 0.05  # what stays below, away from the crease
    largest = 0.0
    with HiroWorld() as world:

        def look() -> None:
            nonlocal largest
            largest = max(largest, _shift(cloth, start, near).max())

        simulated = SimulatedRobot(CellSimulation(world, cloth), on_step=look)
        plan = MotionPlanner(robot).plan_motion(
            FOLD, silhouette_from_points(cloth.top_surface_in_table), simulated.joint_positions()
        )
        MotionExecutor(simulated, robot).run(plan)
        simulated.wait_until(simulated.now() + 1.0)
    end = _shift(cloth, start, near)
    return {
        "shape": shape,
        "grasped_hem_moved_mm": 1e3 * float(_shift(cloth, start, far).mean()),
        "lower_layer_at_the_end_mm": 1e3 * float(_shift(cloth, start, lower).max()),
        "largest_while_moving_mm": 1e3 * largest,
        "largest_at_the_end_mm": 1e3 * float(end.max()),
        "mean_at_the_end_mm": 1e3 * float(end.mean()),
        "motion_s": plan.duration,
        "settled": bool(cloth.settled),
    }


def _shift(cloth: Cloth, start: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Horizontal shifts of the chosen vertices, metres."""
    return np.linalg.norm((cloth.positions_in_table - start)[chosen, :2], axis=1)
