"""`./cell evaluate`: planners beside each other on the same tasks."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import torch
from rich.console import Console
from rich.progress import MofNCompleteColumn, Progress, TimeElapsedColumn

from emd_cell.bench import machine
from emd_cell.evaluation.execution import Record
from emd_cell.evaluation.picture import draw_examples
from emd_cell.evaluation.run import Evaluation, evaluate
from emd_cell.evaluation.table import markdown, rows_of
from emd_cloth_sim.json_file import write_json
from emd_core.whole_file import write_text


def evaluate_planners(
    evaluation: Evaluation,
    json_file: Path,
    workers: int,
    arguments: Sequence[str],
    console: Console,
) -> str:
    """Evaluate; write JSON, the table (.md) and the examples (.png) beside it; give the table.

    Raises:
        InvalidInputError: If the journal beside the JSON is another evaluation's.
        ModelError: If the weights cannot be used.
    """
    journal = json_file.with_suffix(".journal.jsonl")
    columns = (*Progress.get_default_columns(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console) as progress:
        task = progress.add_task("tasks", total=len(evaluation.jobs))
        records = evaluate(
            evaluation, journal, workers, lambda done, _: progress.update(task, completed=done)
        )
    rows = rows_of(records)
    report = {
        "command": shlex.join(["./cell", "evaluate", *arguments]),
        "machine": machine(),
        "config": {
            "preset": asdict(evaluation.preset),
            "reach": evaluation.reach and asdict(evaluation.reach),
            "seed": evaluation.seed,
            "identity": evaluation.identity,
            "torch": torch.__version__,
        },
        "rows": rows,
        "records": [record.as_entry() for record in records],
    }
    write_json(json_file, report)
    table = markdown(rows)
    write_text(json_file.with_suffix(".md"), table)
    draw_examples(evaluation, _to_draw(evaluation, records), json_file.with_suffix(".png"))
    journal.unlink()
    return table


def _to_draw(evaluation: Evaluation, records: Sequence[Record]) -> list[Record]:
    """The records of the planner that was named last."""
    return [record for record in records if record.planner == evaluation.planners[-1]]
