"""A contact sheet of the best, the median and the worst task of a planner."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from emd_cell.evaluation.execution import Record
from emd_cell.evaluation.run import Evaluation, final_state
from emd_cloth_sim.evaluation_picture import draw_rows

MARGIN = 0.02  # metres
HIGHEST = 0.06


def draw_examples(evaluation: Evaluation, records: Sequence[Record], path: Path) -> None:
    """Draw before, goal and outcome of three tasks, coloured by height, seen from above."""
    order = sorted(records, key=lambda record: record.voxel_mse / max(record.idle_mse, 1e-9))
    chosen = [("best", order[0]), ("median", order[len(order) // 2]), ("worst", order[-1])]
    rows = []
    for name, record in chosen:
        task = next(task for task in evaluation.tasks if task.name == record.task)
        titles = (
            f"{name}: task {task.name}, {task.steps} steps",
            f"goal (do nothing {record.idle_mse:.3f})",
            f"{record.planner}: MSE {record.voxel_mse:.3f}, IoU {record.silhouette_iou:.2f}",
        )
        rows.append(((task.start, task.goal, final_state(evaluation, record)), titles))
    draw_rows(rows, path, MARGIN, HIGHEST)
