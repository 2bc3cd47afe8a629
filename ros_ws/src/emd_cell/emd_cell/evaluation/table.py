"""Records averaged into rows, as JSON and as a Markdown table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from emd_cell.evaluation.execution import Record

FIGURES = ("voxel_mse", "relative_mse", "voxel_iou", "silhouette_iou", "vertex_mm")
HEADINGS = ("voxel MSE", "over do nothing", "voxel IoU", "silhouette IoU", "vertices, mm")


def rows_of(records: Sequence[Record]) -> list[dict[str, Any]]:
    """Average the records of each planner, group and mode, in the order in which they first come.

    `relative_mse` has as its mean the mean MSE over the mean of doing nothing, and as its median
    and standard deviation those of the tasks' ratios.
    """
    keys = dict.fromkeys((r.group, r.planner, r.mode) for r in records)
    return [
        _row([r for r in records if (r.group, r.planner, r.mode) == key]) for key in sorted(keys)
    ]


def _row(records: Sequence[Record]) -> dict[str, Any]:
    first = records[0]
    row: dict[str, Any] = {"planner": first.planner, "group": first.group, "mode": first.mode}
    if first.group.isdigit():
        row["steps"] = int(first.group)
    row["n"] = len(records)
    for name in FIGURES:
        if name == "relative_mse":
            ratios = np.array([r.voxel_mse / max(r.idle_mse, 1e-9) for r in records])
            idle = float(np.mean([r.idle_mse for r in records]))
            row[name] = _spread(ratios)
            row[name]["mean"] = float(np.mean([r.voxel_mse for r in records])) / max(idle, 1e-9)
        else:
            row[name] = _spread(np.array([getattr(r, name) for r in records]))
    times = [r.plan_ms for r in records]
    row["plan_ms"] = {"p50": float(np.median(times)), "p95": float(np.percentile(times, 95))}
    row["executable_share"] = float(np.mean([r.executable for r in records]))
    row["failures"] = sum(bool(r.failure) for r in records)
    return row


def _spread(values: np.ndarray) -> dict[str, float]:
    return {
        "mean": float(values.mean()),
        "sd": float(values.std()),
        "median": float(np.median(values)),
    }


def markdown(rows: Sequence[dict[str, Any]]) -> str:
    """Write rows as a table: mean (standard deviation) median."""
    heads = ["task", "planner", "mode", "n", *HEADINGS, "plan p50 / p95, ms", "in reach", "failed"]
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    for row in rows:
        digits = {"vertex_mm": 1, "voxel_mse": 4}
        cells = [str(row.get("steps", row["group"])), row["planner"], row["mode"], str(row["n"])]
        for name in FIGURES:
            n, figure = digits.get(name, 2), row[name]
            cells.append(f"{figure['mean']:.{n}f} ({figure['sd']:.{n}f}) {figure['median']:.{n}f}")
        cells.append(f"{row['plan_ms']['p50']:.0f} / {row['plan_ms']['p95']:.0f}")
        cells += [f"{row['executable_share']:.0%}", str(row["failures"])]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"
