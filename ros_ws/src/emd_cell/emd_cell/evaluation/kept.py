"""Executed plans as training data: what hands did where a planner sent them, misses too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emd_cell.evaluation.tasks import Task
from emd_cloth_sim.presets import ClothPreset
from emd_core.frames import FloatArray
from emd_core.manipulation import Manipulation
from emd_core.sequence_shard import SequenceShard


def as_shard(
    task: Task,
    states: Sequence[FloatArray],
    done: Sequence[Manipulation],
    preset: ClothPreset,
) -> SequenceShard:
    """Make a data set's file of one executed plan.

    Args:
        task: What was planned for; the new sequence belongs to the split of this one's.
        states: Mid-surfaces before, between and after, each (V, 3), metres, n + 1 of them.
        done: The n manipulations that were executed, at least 1.
        preset: The cloth that executed them.
    """
    normalise = task.field_of_view.normalised_from_table
    grids = [np.packbits(task.grid(state).occupancy) for state in states]
    arrays: dict[str, NDArray[Any]] = {
        "grids": np.array([grids], dtype=np.uint8),
        "states": np.array([[normalise(state) for state in states]], dtype=np.float16),
        "picks": np.array([[normalise(m.grasp_points_in_table) for m in done]], np.float32),
        "moves": np.array([[normalise(m.displacement_in_table) for m in done]], np.float32),
        "indices": np.array([task.sequence], dtype=np.int64),
    }
    return SequenceShard(arrays, (), {"cloth": asdict(preset.cloth), "task": task.name})
