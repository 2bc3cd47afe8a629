"""The folding loop: perceive, plan, execute the first manipulation, look again, re-plan (V-A)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from emd_cell.report import DemoReport, Score, StepReport, StripColumn, error_entry
from emd_cell.ros.cell_client import CellClient, Plan
from emd_core.errors import CellError
from emd_core.metrics import voxel_mse
from emd_core.voxel_grid import VoxelGrid


@dataclass(frozen=True)
class FoldingConfig:
    """When the loop goes on.

    Attributes:
        steps: Manipulations planned at the start; each execution leaves one fewer to plan.
        retries: Further single manipulations if the goal is not reached after `steps`.
        done_mse: Voxel MSE to the goal, as the camera sees it, below which the cloth is folded.
        gain: A further manipulation is only made if it is predicted to lower the MSE to this share
            of the present one.
        seed: Of the planner's random initialisations.
    """

    steps: int = 1
    retries: int = 1
    done_mse: float = 0.008
    gain: float = 0.7
    seed: int = 0


@dataclass
class FoldingTrace:
    """What the loop saw, for pictures.

    Attributes:
        columns: Before, and predicted and reached after every manipulation.
        phase: What the cell is doing, for a person who watches.
    """

    columns: list[StripColumn] = field(default_factory=list)
    phase: str = ""


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
        """Fold until done; the report holds the error with which it ended, if any."""
        seen = self._look("before")
        self._report.initial = self._report.final = self._score(seen)
        remaining = self._config.steps
        retries = self._config.retries
        while remaining > 0:
            step = StepReport()
            self._report.steps.append(step)
            try:
                seen = self._fold_once(seen, remaining, step)
            except CellError as err:
                step.error = error_entry(err)
                raise
            self._report.final = step.executed = self._score(seen)
            remaining -= 1
            if (
                remaining == 0
                and retries > 0
                and voxel_mse(seen, self._goal) > self._config.done_mse
            ):
                if not self._worth_another(seen):
                    return
                remaining, retries = 1, retries - 1

    def _fold_once(self, seen: VoxelGrid, remaining: int, step: StepReport) -> VoxelGrid:
        plan = self._plan(seen, remaining)
        step.plan_ms, step.predicted_mse = plan.planning_ms, plan.predicted_loss
        step.planned = plan.manipulations[0].as_entry()
        number = len(self._report.steps)
        self.trace.columns.append(StripColumn(f"predicted {number}", plan.predicted_grids[0]))
        grasped = self._client.execute(
            plan.manipulations[0],
            lambda phase, progress: self._on_phase(f"executing: {phase} {progress:.0%}"),
        )
        step.grasped = grasped.as_entry()
        return self._look(f"after {number}")

    def _plan(self, seen: VoxelGrid, steps: int) -> Plan:
        self._on_phase("planning")
        return self._client.plan(
            seen,
            self._goal,
            steps,
            self._config.seed,
            on_feedback=lambda iteration, loss: self._on_phase(
                f"planning: iteration {iteration}, predicted loss {loss:.4f}"
            ),
        )

    def _worth_another(self, seen: VoxelGrid) -> bool:
        plan = self._plan(seen, 1)
        return plan.predicted_loss < self._config.gain * voxel_mse(seen, self._goal)

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
