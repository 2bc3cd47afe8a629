"""`./cell plan`: two voxel grids to a plan, without ROS."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from emd_cell.goals import load_goal
from emd_core.voxel_grid import VoxelGrid
from emd_core.whole_file import write_text
from emd_planner.config import PLANNERS, ReachConfig
from emd_planner.memory import keep_freed_memory
from emd_planner.plan import plan
from emd_planner.trust import PlanFigures, load_trust
from emd_planner.weights import SHIPPED_WEIGHTS, load_net


def plan_files(
    initial: Path, goal: str, steps: int, seed: int, weights: Path | None, out: Path | None
) -> dict[str, Any]:
    """Plan and give the plan as a JSON-like entry; points and displacements in metres.

    Raises:
        InvalidInputError: If a grid cannot be used.
        ModelError: If the weights cannot be used.
        NoPlanError: If the search finds nothing.
    """
    keep_freed_memory()
    trust = load_trust(weights or SHIPPED_WEIGHTS)
    found = plan(
        load_net(weights),
        VoxelGrid.load(initial),
        load_goal(goal).grid,
        steps,
        PLANNERS["ours"],
        ReachConfig(),
        seed,
    )
    entry = {
        "manipulations": [item.as_entry() for item in found.manipulations],
        "predicted_mse": found.predicted_loss,
        "expected_mse": found.expected_error,
        "failure_probability": trust and trust.failure_probability(PlanFigures.of(found)),
        "initial_mse": found.initial_loss,
        "reconstruction_mse": found.reconstruction_loss,
        "plan_ms": found.planning_ms,
        "iterations": found.iterations,
    }
    if out is not None:
        write_text(out, json.dumps(entry, indent=1))
    return entry
