"""Execution of plans in the cloth simulation, and how far the outcome is from the goal."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any

import numpy as np

from emd_cell.evaluation.rivals import Problem, Rival, within_reach
from emd_cell.evaluation.tasks import Task
from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.manipulate import manipulate
from emd_cloth_sim.presets import ClothPreset
from emd_core.errors import SimulationError
from emd_core.frames import FloatArray
from emd_core.manipulation import Manipulation
from emd_core.metrics import silhouette_iou, voxel_iou, voxel_mse
from emd_core.voxel_grid import VoxelGrid
from emd_planner.config import ReachConfig
from emd_planner.trust import PlanFigures

MODES = ("replan", "open")


@dataclass(frozen=True)
class Record:
    """What one planner made of one task.

    Attributes:
        task: Its name.
        group: Its group.
        planner: The planner's name.
        mode: `replan`: planned anew after every executed step (the paper's procedure); `open`: the
            first plan executed as a whole.
        voxel_mse: Of the outcome with respect to the goal.
        idle_mse: The same of doing nothing.
        voxel_iou: Intersection over union of the occupied voxels.
        silhouette_iou: The same of the occupied columns.
        vertex_mm: Mean distance of corresponding vertices, millimetres.
        plan_ms: Time of the first plan, milliseconds.
        executable: Whether all executed manipulations were within the arms' reach unchanged.
        failure: Why a plan or the simulation failed; empty if neither did.
        figures: What the planner told of the first plan, if anything.
    """

    task: str
    group: str
    planner: str
    mode: str
    voxel_mse: float
    idle_mse: float
    voxel_iou: float
    silhouette_iou: float
    vertex_mm: float
    plan_ms: float
    executable: bool
    failure: str
    figures: PlanFigures | None = None

    def as_entry(self) -> dict[str, object]:
        """Give it as JSON holds it."""
        return asdict(self)

    @classmethod
    def from_entry(cls, entry: dict[str, Any]) -> Record:
        """Take it from what JSON held."""
        figures = entry.get("figures")
        return cls(**{**entry, "figures": figures and PlanFigures(**figures)})


@dataclass(frozen=True)
class Performance:
    """What was done for a task, and what became of it.

    Attributes:
        record: How it is judged.
        manipulations: Those that the simulation carried out, without failed ones.
        states: Mid-surfaces before, between and after these, each (V, 3), metres.
        outcome: Mid-surface at the end, likewise, also of what failed.
    """

    record: Record
    manipulations: tuple[Manipulation, ...]
    states: tuple[FloatArray, ...]
    outcome: FloatArray


def perform(
    task: Task,
    name: str,
    rival: Rival,
    mode: str,
    preset: ClothPreset,
    seed: int,
    reach: ReachConfig | None = None,
) -> Performance:
    """Let a planner do a task.

    `reach` is what `executable` is judged by; None: the cell's arms.
    """
    rng = np.random.default_rng([seed, *hashlib.sha256(f"{task.name}{name}".encode()).digest()])
    cloth = Cloth.from_positions(task.start, preset.cloth)
    goal, idle = task.grid(task.goal), task.grid(cloth.positions_in_table)
    course = _carry_out(task, rival, mode, preset, cloth, rng, reach or ReachConfig())
    outcome = cloth.positions_in_table
    grid = task.grid(outcome)
    if name == "empty":
        grid = VoxelGrid(np.zeros_like(grid.occupancy), grid.field_of_view)
    record = Record(
        task=task.name,
        group=task.group,
        planner=name,
        mode=mode,
        voxel_mse=voxel_mse(grid, goal),
        idle_mse=voxel_mse(idle, goal),
        voxel_iou=voxel_iou(grid, goal),
        silhouette_iou=silhouette_iou(grid, goal),
        vertex_mm=1e3 * float(np.linalg.norm(outcome - task.goal, axis=1).mean()),
        plan_ms=course.plan_ms,
        executable=course.executable,
        failure=course.failure,
        figures=course.figures,
    )
    return Performance(record, tuple(course.done), tuple(course.states), outcome)


@dataclass
class _Course:
    """What has been planned and carried out of a task so far.

    Attributes:
        plan_ms: Time of the first plan, milliseconds.
        figures: What the planner told of it.
        failure: The first one; empty if there was none.
        executable: Whether all manipulations were within reach.
        done: Those that the simulation carried out, up to the first that failed.
        states: Mid-surfaces before, between and after these, each (V, 3), metres.
    """

    plan_ms: float = 0.0
    figures: PlanFigures | None = None
    failure: str = ""
    executable: bool = True
    done: list[Manipulation] = field(default_factory=list)
    states: list[FloatArray] = field(default_factory=list)


def _carry_out(
    task: Task,
    rival: Rival,
    mode: str,
    preset: ClothPreset,
    cloth: Cloth,
    rng: np.random.Generator,
    reach: ReachConfig,
) -> _Course:
    """Plan, as often as the mode says, and move the cloth by what was planned."""
    course = _Course(states=[cloth.positions_in_table])
    goal, regions = task.grid(task.goal), [np.array(reach.left), np.array(reach.right)]
    left: tuple[Manipulation, ...] = ()
    for step in range(task.steps):
        if mode == "replan" or step == 0:
            problem = Problem(
                task.grid(cloth.positions_in_table),
                goal,
                task.steps - step,
                task.recorded[step:],
                max(preset.cloth.spacing),
                rng,
                partial(_tried_out, task, cloth, preset),
            )
            proposal = rival.propose(problem)
            left = proposal.manipulations
            if step == 0:
                course.plan_ms, course.figures = proposal.planning_ms, proposal.figures
            course.failure = course.failure or proposal.failure
        if not left:
            break
        manipulation, left = unwrapped(left[0], cloth, task), left[1:]
        course.executable = course.executable and within_reach(manipulation, regions)
        try:
            failed = manipulate(cloth, manipulation, preset.path).diagnostics.failure
        except SimulationError as err:
            course.failure = course.failure or str(err)
            break
        course.failure = course.failure or failed
        if not failed and len(course.done) == step:
            course.done.append(manipulation)
            course.states.append(cloth.positions_in_table)
    return course


def _tried_out(
    task: Task, cloth: Cloth, preset: ClothPreset, manipulations: Sequence[Manipulation]
) -> VoxelGrid:
    """Give the grid to which manipulations lead, and leave the cloth as it was."""
    before = cloth.remember()
    try:
        for manipulation in manipulations:
            manipulate(cloth, unwrapped(manipulation, cloth, task), preset.path)
        return task.grid(cloth.positions_in_table)
    finally:
        cloth.go_back(before)


def unwrapped(manipulation: Manipulation, cloth: Cloth, task: Task) -> Manipulation:
    """Move grasp points by whole fields of view to where the cloth is.

    Grids wrap: cloth beyond one edge is seen, and grasped by the plan, at the opposite one.
    """
    extent = 2.0 * task.field_of_view.half_extent
    shifts = extent * np.array([[i, j] for i in (0, -1, 1) for j in (0, -1, 1)], dtype=float)
    positions = cloth.positions_in_table[:, :2]
    points = manipulation.grasp_points_in_table.copy()
    for hand in np.flatnonzero(manipulation.used):
        places = points[hand] + shifts
        distances = np.linalg.norm(places[:, None] - positions, axis=2).min(axis=1)
        # As it is, unless the cloth is clearly elsewhere.
        distances[0] -= 1e-9
        points[hand] = places[int(distances.argmin())]
    return Manipulation(points, manipulation.displacement_in_table)
