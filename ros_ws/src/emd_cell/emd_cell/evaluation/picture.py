"""A contact sheet of the best, the median and the worst task of a planner."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np

from emd_cell.evaluation.execution import Record
from emd_cell.evaluation.run import Evaluation, final_state
from emd_cloth_sim.evaluation_picture import height_image
from emd_core.frames import FloatArray
from emd_core.whole_file import whole_file

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402  (the backend is chosen first)

MARGIN = 0.02
HIGHEST = 0.06


def draw_examples(evaluation: Evaluation, records: Sequence[Record], path: Path) -> None:
    """Draw before, goal and outcome of three tasks, coloured by height, seen from above."""
    order = sorted(records, key=lambda record: record.voxel_mse / max(record.idle_mse, 1e-9))
    chosen = [("best", order[0]), ("median", order[len(order) // 2]), ("worst", order[-1])]
    figure, axes = plt.subplots(len(chosen), 3, figsize=(8.4, 9.0))
    for (name, record), row in zip(chosen, axes, strict=True):
        task = next(task for task in evaluation.tasks if task.name == record.task)
        states = (task.start, task.goal, final_state(evaluation, record))
        titles = (
            f"{name}: task {task.name}, {task.steps} steps",
            f"goal (do nothing {record.idle_mse:.3f})",
            f"{record.planner}: MSE {record.voxel_mse:.3f}, IoU {record.silhouette_iou:.2f}",
        )
        _draw_states(states, titles, row)
    figure.tight_layout(pad=0.6)
    try:
        with whole_file(path) as temporary:
            figure.savefig(temporary, dpi=100)
    finally:
        plt.close(figure)


def _draw_states(
    states: Sequence[FloatArray], titles: Sequence[str], row: Sequence[plt.Axes]
) -> None:
    corners = np.concatenate(states)[:, :2]
    low, high = corners.min(axis=0) - MARGIN, corners.max(axis=0) + MARGIN
    width = float((high - low).max())
    low = 0.5 * (low + high - width)
    for positions, title, axis in zip(states, titles, row, strict=True):
        image = height_image(positions, low, width)
        axis.imshow(image, vmin=0.0, vmax=HIGHEST, cmap="viridis", interpolation="nearest")
        axis.set_title(title, fontsize=8)
        axis.set_xticks([])
        axis.set_yticks([])
