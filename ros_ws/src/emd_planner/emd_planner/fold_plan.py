"""What the planner answers, and what it tells on the way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emd_core.manipulation import Manipulation
from emd_core.voxel_grid import VoxelGrid
from emd_planner.planner import SearchProgress


@dataclass(frozen=True)
class PlanningProgress:
    """A search for a plan of `steps` manipulations after an iteration.

    Attributes:
        steps: Manipulations in the plans that are tried now.
        search: The search's own progress; its values are normalised.
    """

    steps: int
    search: SearchProgress


@dataclass(frozen=True)
class FoldPlan:
    """Manipulations and what the net expects of them.

    Attributes:
        manipulations: In order; table frame, metres, NaN points for unused hands.
        predicted_probabilities: After each manipulation, shape (n, X, Y, Z), float32, 0..1.
        predicted_grids: The same, thresholded.
        predicted_loss: loss_s of the last prediction with respect to the goal.
        expected_error: Voxel MSE to be expected of the executed plan's outcome with respect to the
            goal, if the net's probabilities are right: predicted_loss and what the net is unsure
            of. A plan is worth executing if this is less than what the present state scores.
        initial_loss: loss_s of the initial state: what doing nothing scores.
        reconstruction_loss: loss_s of D(E(initial)) to the initial state: how well the net knows
            states like this one. A gain smaller than it is within the net's own error.
        reach_excess: Metres by which grasp and release points lie outside the arms' reach,
            summed; 0 without reach limits.
        planning_ms: Time taken, milliseconds.
        iterations: Iterations of all searches.
    """

    manipulations: list[Manipulation]
    predicted_probabilities: NDArray[np.float32]
    predicted_grids: list[VoxelGrid]
    predicted_loss: float
    expected_error: float
    initial_loss: float
    reconstruction_loss: float
    reach_excess: float
    planning_ms: float
    iterations: int
