"""Plans that wait for the operator's word, and what came of those carried out."""

from __future__ import annotations

import math
from dataclasses import dataclass

from emd_console.cell_port import Observation, Plan
from emd_console.goals import Goal


@dataclass(frozen=True)
class Proposal:
    """A plan that waits for the operator's word.

    Attributes:
        goal: What it leads to.
        seen: The state from which it was made.
        plan: The manipulations, with predictions.
        mse_now: Voxel MSE of that state to the goal.
    """

    goal: Goal
    seen: Observation
    plan: Plan
    mse_now: float


@dataclass(frozen=True)
class Fold:
    """A manipulation that was carried out.

    Attributes:
        kind: taught or planned.
        goal: Title of its goal, or empty.
        mse_before: Voxel MSE to the goal before, as the camera sees it; None without a goal.
        mse_after: The same after it.
        seconds: From its start to the look after it.
        finished: Seconds of the desk's clock.
        example: Number of its recording.
    """

    kind: str
    goal: str
    mse_before: float | None
    mse_after: float | None
    seconds: float
    finished: float
    example: int

    @property
    def outcome(self) -> str:
        """Say in words what came of it."""
        if self.mse_after is None or self.mse_before is None:
            return f"done in {self.seconds:.0f} s; recorded as example {self.example}"
        return (
            f"voxel MSE to the goal {self.mse_before:.4f} before, {self.mse_after:.4f} after; "
            f"recorded as example {self.example}"
        )


def plan_figures(plan: Plan) -> dict[str, float | None]:
    """A plan's figures as JSON holds them; unknown ones are None."""
    figures = {
        "predicted_loss": plan.predicted_loss,
        "expected_error": plan.expected_error,
        "failure_probability": plan.failure_probability,
        "planning_seconds": plan.planning_seconds,
    }
    return {name: value if math.isfinite(value) else None for name, value in figures.items()}
