"""The course of a training run: a CSV of scores, events for TensorBoard and a picture."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

from tensorboardX import SummaryWriter

from emd_core.whole_file import whole_file


class TrainingLog:
    """Rows of scores, in `log.csv` and as events for TensorBoard.

    A run that goes on after an interruption goes on with its rows.
    """

    def __init__(self, folder: Path, rows: list[dict[str, float]]) -> None:
        """Start with the rows of a checkpoint (or none) and write them to the folder."""
        self.path = folder / "log.csv"
        self.rows = list(rows)
        self._write()
        # Events after the checkpoint's last row are of steps that will be done anew.
        last = int(rows[-1]["iteration"]) + 1 if rows else 0
        self._events = SummaryWriter(str(folder / "tensorboard"), purge_step=last)

    def add(self, row: dict[str, float]) -> None:
        """Append a row; all rows have the same columns."""
        self.rows.append(row)
        self._write()
        for name, value in row.items():
            if name != "iteration":
                self._events.add_scalar(name, value, int(row["iteration"]))
        self._events.flush()

    def _write(self) -> None:
        if not self.rows:
            return
        with whole_file(self.path) as temporary, open(temporary, "w", newline="") as stream:
            writer = csv.DictWriter(stream, fieldnames=list(self.rows[0]))
            writer.writeheader()
            writer.writerows(self.rows)


def draw_curve(rows: list[dict[str, float]], path: Path) -> None:
    """Draw training and held-out losses over time, with the baselines as level lines."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    FigureCanvasAgg(figure)
    axes: Any = figure.add_subplot()
    minutes = [row["seconds"] / 60.0 for row in rows]
    lines = {
        "train_loss_s": ("training, loss_s", "tab:gray", "-"),
        "one_step": ("held out, 1 step", "tab:blue", "-"),
        "two_steps": ("held out, 2 steps", "tab:orange", "-"),
        "one_step_do_nothing": ("do nothing, 1 step", "tab:blue", ":"),
        "one_step_empty": ("empty grid, 1 step", "tab:green", ":"),
        "one_step_mean": ("mean grid, 1 step", "tab:red", ":"),
    }
    for column, (label, colour, style) in lines.items():
        if column in rows[0]:
            values = [row[column] for row in rows]
            axes.plot(minutes, values, style, color=colour, label=label)
    axes.set_xlabel("minutes of training")
    axes.set_ylabel("mean squared error per voxel")
    axes.set_yscale("log")
    axes.grid(True, which="both", alpha=0.3)
    axes.legend()
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=120)
