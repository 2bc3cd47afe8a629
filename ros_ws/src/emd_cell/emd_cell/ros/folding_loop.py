"""The folding loop: perceive, plan, execute the first manipulation, look again, re-plan (V-A)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from emd_cell.report import DemoReport, Score, StepReport, StripColumn, error_entry
from emd_cell.ros.cell_client import CellClient, Plan
from emd_core.errors import (
    CellError,
    CollisionError,
    DoubtfulPlanError,
    InvalidInputError,
    NoHemError,
    NoPlanError,
    OutOfReachError,
)
from emd_core.metrics import voxel_mse
from emd_core.voxel_grid import VoxelGrid

# Errors after which nothing has moved and another plan may do.
_REFUSALS = (
    NoPlanError,
    DoubtfulPlanError,
    NoHemError,
    OutOfReachError,
    CollisionError,
    InvalidInputError,
)


@dataclass(frozen=True)
class FoldingConfig:
    """When the loop goes on.

    Attributes:
        steps: Manipulations planned at the start; each execution leaves one fewer to plan.
        retries: Further single manipulations if the goal is not reached after `steps`.
        done_mse: Voxel MSE to the goal, as the camera sees it, below which the cloth is folded.
        restarts: Random initialisations of the search; more than the paper's 10, as the weights
            shipped now are trained little.
        attempts: Plans tried, each from another seed, when one cannot be made or carried out.
        seed: Of the planner's random initialisations.
    """

    steps: int = 1
    retries: int = 1
    done_mse: float = 0.008
    restarts: int = 24
    attempts: int = 3
    seed: int = 0


@dataclass
class FoldingTrace:
    """What the loop saw, for pictures.

    Attributes:
        columns: Before, and predicted and reached after every manipulation.
    """

    columns: list[StripColumn] = field(default_factory=list)


class FoldingLoop:
    """Folds the cloth towards a goal, as a client of the cell's nodes."""

    def __init__(
        self,
        client: CellClient,
        goal: VoxelGrid,
        config: FoldingConfig,
        report: DemoReport,
        on_phase: Callable[[str], None] | None = None,
    ) -> None:
        """Fold towards `goal`, filling `report` as it goes; `on_phase` is told what happens."""
        self._client = client
        self._goal = goal
        self._config = config
        self._report = report
        self._on_phase = on_phase or (lambda text: None)
        self.trace = FoldingTrace()

    def run(self) -> None:
        """Fold until done; `report` has every step, the refused ones with their errors.

        Raises:
            CellError: If a planned manipulation could not be carried out. A further one that is
                only meant to improve the fold may fail.
        """
        seen = self._look("before")
        self._report.initial = self._report.final = self._score(seen)
        for remaining in range(self._config.steps, 0, -1):
            seen = self._step(seen, remaining)
        for _ in range(self._config.retries):
            if voxel_mse(seen, self._goal) <= self._config.done_mse:
                return
            try:
                better = self._improve(seen)
            except _REFUSALS:
                return
            if better is None:
                return
            seen = better

    def _step(self, seen: VoxelGrid, remaining: int) -> VoxelGrid:
        """Plan and carry out one manipulation; a refused plan is followed by another one."""
        for seed in range(self._config.seed, self._config.seed + self._config.attempts - 1):
            try:
                return self._plan_and_fold(seen, remaining, seed)
            except _REFUSALS:
                continue
        return self._plan_and_fold(seen, remaining, self._config.seed + self._config.attempts - 1)

    def _plan_and_fold(self, seen: VoxelGrid, remaining: int, seed: int) -> VoxelGrid:
        with self._reported_step() as step:
            return self._carry_out(self._plan(seen, remaining, seed), step)

    def _improve(self, seen: VoxelGrid) -> VoxelGrid | None:
        """Carry out one more manipulation; None if no gain is to be expected."""
        try:
            plan = self._plan(seen, 1, self._config.seed)
        except NoPlanError:
            return None
        if plan.expected_error >= voxel_mse(seen, self._goal):
            return None
        with self._reported_step() as step:
            return self._carry_out(plan, step)

    @contextmanager
    def _reported_step(self) -> Iterator[StepReport]:
        """Give a new step of the report; an error of the body is noted in it."""
        step = StepReport()
        self._report.steps.append(step)
        try:
            yield step
        except CellError as err:
            step.error = error_entry(err)
            raise

    def _carry_out(self, plan: Plan, step: StepReport) -> VoxelGrid:
        """Execute a plan's first manipulation and look at the outcome."""
        step.plan_ms, step.predicted_mse = plan.planning_ms, plan.predicted_loss
        step.planned = plan.manipulations[0].as_entry()
        number = sum(item.executed is not None for item in self._report.steps) + 1
        self.trace.columns.append(StripColumn(f"predicted {number}", plan.predicted_grids[0]))
        grasped = self._client.execute(
            plan.manipulations[0],
            lambda phase, progress: self._on_phase(f"executing: {phase} {progress:.0%}"),
        )
        step.grasped = grasped.as_entry()
        seen = self._look(f"after {number}")
        self._report.final = step.executed = self._score(seen)
        return seen

    def _plan(self, seen: VoxelGrid, steps: int, seed: int) -> Plan:
        self._on_phase("planning")
        return self._client.plan(
            seen,
            self._goal,
            steps,
            seed,
            self._config.restarts,
            on_feedback=lambda iteration, loss: self._on_phase(
                f"planning: iteration {iteration}, predicted loss {loss:.4f}"
            ),
        )

    def _look(self, title: str) -> VoxelGrid:
        self._on_phase("looking at the cloth")
        grid = self._client.capture().grid
        self.trace.columns.append(StripColumn(title, grid, self._picture()))
        return grid

    def _picture(self) -> NDArray[np.uint8] | None:
        frames = self._client.overview_frames
        return frames[-1] if frames else None

    def _score(self, seen: VoxelGrid) -> Score:
        return Score.of(self._client.true_grid(), seen, self._goal)
