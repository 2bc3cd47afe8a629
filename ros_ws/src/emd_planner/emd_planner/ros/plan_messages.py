"""Plans and the progress of a search as messages."""

from __future__ import annotations

import math

import numpy as np
from std_msgs.msg import Header

from emd_core.manipulation import Manipulation
from emd_core.ros import conversions
from emd_core.voxel_grid import VoxelGrid
from emd_msgs_py.action import PlanFold
from emd_msgs_py.msg import FoldPlan as FoldPlanMsg
from emd_planner.fold_plan import FoldPlan, PlanningProgress


def plan_to_message(found: FoldPlan, header: Header, failure_probability: float) -> FoldPlanMsg:
    """Turn a plan into a message in the header's frame, the table's."""
    return FoldPlanMsg(
        header=header,
        manipulations=[
            conversions.manipulation_to_message(item, header) for item in found.manipulations
        ],
        predicted_grids=[
            conversions.voxel_grid_to_message(grid, header) for grid in found.predicted_grids
        ],
        predicted_loss=found.predicted_loss,
        expected_error=found.expected_error,
        failure_probability=failure_probability,
        reconstruction_loss=found.reconstruction_loss,
    )


def progress_to_feedback(
    progress: PlanningProgress, initial: VoxelGrid, header: Header
) -> PlanFold.Feedback:
    """Turn a search's progress into feedback; whether a hand is used is decided at the end."""
    search = progress.search
    rows = np.asarray(search.best_values, dtype=np.float64)
    made = [Manipulation.from_network(row, (True, True), initial.field_of_view) for row in rows]
    best_plan = FoldPlanMsg(
        header=header,
        manipulations=[conversions.manipulation_to_message(item, header) for item in made],
        predicted_loss=search.best_cost,
        failure_probability=math.nan,
    )
    return PlanFold.Feedback(
        iteration=search.iteration, best_loss=search.best_cost, best_plan=best_plan
    )
