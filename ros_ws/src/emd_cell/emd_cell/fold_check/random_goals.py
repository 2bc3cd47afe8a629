"""Seeded goals that one manipulation within the arms' reach makes of the cell's flat cloth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from emd_arm_executor.motion_planner import MotionPlanner
from emd_arm_executor.silhouette import Silhouette
from emd_cell.motion_check.random_tasks import random_fold
from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.manipulate import manipulate
from emd_core.errors import CellError, SimulationError
from emd_core.frames import FieldOfView, FloatArray
from emd_core.independent_manipulation import HandsManipulation
from emd_core.manipulation import Manipulation
from emd_core.metrics import voxel_mse
from emd_core.voxel_grid import VoxelGrid, voxelise

# A goal differs from the flat cloth by this voxel MSE at least; that of a half fold is 0.035.
_LEAST_CHANGE = 0.01
_CELL = 0.004


@dataclass(frozen=True)
class FoldGoal:
    """What the cloth should look like.

    Attributes:
        grid: The goal.
        manipulation: What made it of the flat cloth, without a robot.
        idle_mse: Voxel MSE of the flat cloth with respect to it.
    """

    grid: VoxelGrid
    manipulation: Manipulation
    idle_mse: float


def random_goal(planner: MotionPlanner, seed: int, index: int) -> FoldGoal:
    """Make goal number `index`; the same seed and index give the same goal.

    A hem is grasped 0 to 2 cm inside it, by one hand or, half of the time, by both, and moves
    inwards within 30 degrees of its normal. Tried again until the arms can do it (the planner
    decides for the flat cloth) and the cloth looks different afterwards.
    """
    rng = np.random.default_rng((seed, index))
    flat = Cloth(ClothConfig())
    before = true_grid(flat)
    size = np.array(flat.config.side_lengths)
    silhouette = flat_silhouette(size, flat.config.thickness)
    while True:
        manipulation = random_manipulation(rng, size)
        try:
            planner.plan_motion(manipulation, silhouette, planner.robot.description.rest)
        except CellError:
            continue
        outcome = fold_without_robot(manipulation)
        if outcome is None:
            continue
        change = voxel_mse(before, outcome)
        if change >= _LEAST_CHANGE:
            return FoldGoal(outcome, manipulation, change)


def random_manipulation(rng: np.random.Generator, size: FloatArray) -> Manipulation:
    """Draw a fold of a flat cloth of this size (2,), metres, by one hand or, as often, by both."""
    points, displacement = random_fold(rng, size, bool(rng.random() < 0.5))
    rows = np.full((2, 2), np.nan)
    rows[: len(points)] = points
    return Manipulation(rows, displacement)


def fold_without_robot(manipulation: HandsManipulation) -> VoxelGrid | None:
    """Give what a manipulation makes of the cell's flat cloth; None if that cannot be believed."""
    cloth = Cloth(ClothConfig())
    try:
        outcome = manipulate(cloth, manipulation)
    except SimulationError:
        return None
    return None if outcome.diagnostics.failure else true_grid(cloth)


def true_grid(cloth: Cloth) -> VoxelGrid:
    """Voxelise a cloth's upper surface as the simulation's node does."""
    surface = cloth.positions_in_table + np.array([0.0, 0.0, cloth.thickness / 2.0])
    return voxelise(surface, FieldOfView())


def flat_silhouette(size: FloatArray, thickness: float) -> Silhouette:
    """Draw a flat cloth of this size (2,) and thickness, metres, amid the field of view."""
    half = FieldOfView().half_extent
    axis = np.arange(-half + _CELL / 2.0, half, _CELL)
    x, y = np.meshgrid(axis, axis, indexing="ij")
    mask = (np.abs(x) < size[0] / 2.0) & (np.abs(y) < size[1] / 2.0)
    return Silhouette(
        mask, np.array([_CELL, _CELL]), np.array([-half, -half]), np.where(mask, thickness, 0.0)
    )
