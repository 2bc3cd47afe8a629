"""Whether plans that fail were doubted: what was foretold of executed plans beside what came."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import mannwhitneyu

from emd_core.errors import InvalidInputError
from emd_core.whole_file import whole_file
from emd_planner.trust import FAILED, PlanFigures, TrustModel

_BINS = 5


@dataclass(frozen=True)
class ExecutedPlan:
    """A plan that was executed as a whole.

    Attributes:
        figures: What the planner told of it.
        failed: Whether its outcome scored more than `FAILED` of doing nothing.
    """

    figures: PlanFigures
    failed: bool


@dataclass(frozen=True)
class DoubtReport:
    """How well a trust model knows which plans fail.

    Attributes:
        plans: How many were executed.
        failed: How many failed.
        auroc: Probability that of a failed and another plan the failed one is doubted more.
        auroc_of_expected_error: The same of the net's expected error over doing nothing alone.
        brier: Mean squared difference of probability and outcome.
        brier_of_rate: The same of always telling the share that failed.
        foretold: Mean probability of equally many plans each, least doubted first.
        came: Share of them that failed.
    """

    plans: int
    failed: int
    auroc: float
    auroc_of_expected_error: float
    brier: float
    brier_of_rate: float
    foretold: tuple[float, ...]
    came: tuple[float, ...]


def read_executed(paths: Sequence[Path], planner: str = "ours") -> list[ExecutedPlan]:
    """Read the plans of a planner from the JSON files of `./cell evaluate --mode open`.

    A task of one step counts in any mode.

    Raises:
        InvalidInputError: If a file is not such a report, or there are no such plans.
    """
    found = []
    for path in paths:
        try:
            records = json.loads(path.read_text())["records"]
        except (OSError, ValueError, KeyError, TypeError) as err:
            raise InvalidInputError(
                f"{path} should be a report of `./cell evaluate`: {err!r}"
            ) from err
        for record in records:
            figures = record.get("figures")
            if record["planner"] == planner and figures and not record["failure"]:
                if record["mode"] == "open" or figures["steps"] == 1:
                    failed = record["voxel_mse"] > FAILED * record["idle_mse"]
                    found.append(ExecutedPlan(PlanFigures(**figures), failed))
    if not found:
        raise InvalidInputError(
            f"{', '.join(map(str, paths))} hold no plan of {planner!r} that was executed as a "
            "whole; make some with `./cell evaluate --mode open`"
        )
    return found


def judge(model: TrustModel, plans: Sequence[ExecutedPlan]) -> DoubtReport:
    """Compare what a model tells of executed plans with what became of them.

    Raises:
        InvalidInputError: If no plan failed, or all did.
    """
    failed = np.array([plan.failed for plan in plans])
    if failed.all() or not failed.any():
        raise InvalidInputError(f"of {len(plans)} plans {failed.sum()} failed: nothing to compare")
    chances = np.array([model.failure_probability(plan.figures) for plan in plans])
    ratios = np.array([p.figures.expected_error / p.figures.initial_loss for p in plans])
    parts = np.array_split(np.argsort(chances, kind="stable"), min(_BINS, len(plans)))
    return DoubtReport(
        len(plans),
        int(failed.sum()),
        _auroc(chances, failed),
        _auroc(ratios, failed),
        float(np.mean((chances - failed) ** 2)),
        float(np.mean((failed.mean() - failed) ** 2)),
        tuple(float(chances[part].mean()) for part in parts),
        tuple(float(failed[part].mean()) for part in parts),
    )


def as_entry(report: DoubtReport) -> dict[str, object]:
    """Give it as JSON holds it."""
    return asdict(report)


def draw(reports: dict[str, DoubtReport], path: Path) -> None:
    """Draw the share of plans that failed over the probability that was foretold."""
    figure = Figure(figsize=(5.0, 5.0), layout="constrained")
    axes = figure.subplots()
    axes.plot([0, 1], [0, 1], color="0.7", linestyle="--", label="as foretold")
    for name, report in reports.items():
        label = f"{name}: {report.plans} plans, AUROC {report.auroc:.2f}"
        axes.plot(report.foretold, report.came, marker="o", label=label)
    axes.set(
        xlim=(0, 1),
        ylim=(0, 1),
        aspect="equal",
        xlabel="probability of failure that was foretold",
        ylabel="share of plans that failed",
    )
    axes.legend(loc="upper left")
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=110)


def _auroc(scores: np.ndarray, failed: np.ndarray) -> float:
    found = mannwhitneyu(scores[failed], scores[~failed])
    return float(found.statistic / (failed.sum() * (~failed).sum()))
