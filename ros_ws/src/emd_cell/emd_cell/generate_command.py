"""`./cell generate` and `./cell inspect`: options to the core, and how it goes on the terminal."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from emd_cloth_sim.contact_sheet import draw_contact_sheet
from emd_cloth_sim.data_statistics import DataStatistics, inspect_data
from emd_cloth_sim.generate import GenerationProgress, Runner, generate
from emd_cloth_sim.generation_config import GenerationConfig
from emd_cloth_sim.ray_workers import RayRunner
from emd_cloth_sim.warm_up import prepare_kernels
from emd_cloth_sim.workers import ProcessRunner, run_here
from emd_core.errors import InvalidInputError
from emd_core.whole_file import write_text

LINE_EVERY = 15.0
"""Seconds between two lines of progress where the output is no terminal."""


def choose_runner(workers: int | None, ray: str | None) -> Runner:
    """Give who simulates: Ray, or as many processes as asked for, by default one a core.

    Raises:
        InvalidInputError: If both are asked for or the number is below 1.
    """
    if ray is not None:
        if workers is not None:
            raise InvalidInputError("give --workers or --ray, not both: Ray uses all its cores")
        return RayRunner(ray)
    count = workers if workers is not None else len(os.sched_getaffinity(0))
    return run_here if count == 1 else ProcessRunner(count)


def run_generate(
    config: GenerationConfig, out: Path, run: Runner, console: Console
) -> GenerationProgress:
    """Generate and show sequences done, rate, time remaining and failures.

    Raises:
        CellError: See `emd_cloth_sim.generate.generate`.
    """
    columns = (
        TextColumn("sequences"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[note]}"),
        TimeElapsedColumn(),
        TextColumn("remaining"),
        TimeRemainingColumn(elapsed_when_finished=False),
    )
    with console.status("compiling the cloth's kernels (once)"):
        prepare_kernels()
    begun = last_line = time.monotonic()
    # A speed estimate over an hour, as single sequences differ a lot.
    with Progress(*columns, console=console, speed_estimate_period=3600.0) as bar:
        task = bar.add_task("sequences", total=config.sequences, note="")

        def show(progress: GenerationProgress) -> None:
            nonlocal last_line
            now = time.monotonic()
            note = _note(progress, config.steps, now - begun)
            if progress.new == 0:
                bar.reset(task, total=progress.asked, completed=progress.done, note=note)
                if progress.done:
                    console.print(f"{progress.done} of {progress.asked} are there already")
                return
            bar.update(task, completed=progress.done, note=note)
            if not console.is_terminal and now - last_line >= LINE_EVERY:
                last_line = now
                console.print(f"{progress.done}/{progress.asked} sequences, {note}")

        return generate(config, out, run, show)


def describe(progress: GenerationProgress, steps: int, seconds: float) -> str:
    """Say in a line what a run has done."""
    return (
        f"{progress.done} of {progress.asked} sequences are there, {progress.new} of them new; "
        f"{_note(progress, steps, seconds)}"
    )


def run_inspect(directory: Path, sheet: Path | None, rows: int) -> DataStatistics:
    """Examine a data set and draw its contact sheet.

    Raises:
        InvalidInputError: If it holds no data or a file cannot be read.
    """
    statistics = inspect_data(directory)
    if statistics.sequences and rows:
        draw_contact_sheet(directory, sheet or directory / "inspect.png", rows)
    return statistics


def write_json(statistics: DataStatistics, path: Path) -> None:
    """Write statistics as JSON, whole or not at all."""
    write_text(path, json.dumps(statistics.as_entry(), indent=1) + "\n")


def report_lines(found: DataStatistics, most_failures: int = 20) -> list[str]:
    """Say what a data set holds, for people."""
    asked = "" if found.asked is None else f" of {found.asked} asked for"
    lines = [
        f"{found.sequences} sequences{asked}, {found.manipulations} manipulations, "
        f"{100 * found.two_handed:.0f} % with two hands",
        f"{len(found.failures)} failed ({100 * found.failed_share:.1f} %), {found.waiting} done "
        "whose shard is not finished",
        f"{found.unsettled} manipulations ended with the cloth still moving, {found.crossed} with "
        f"small crossings, {found.repeated} were simulated again in shorter substeps",
    ]
    for failure in found.failures[:most_failures]:
        step = "start" if failure.step < 0 else f"step {failure.step}"
        lines.append(f"  failed: sequence {failure.index}, {step}: {failure.reason}")
    if len(found.failures) > most_failures:
        lines.append(f"  and {len(found.failures) - most_failures} more; --json lists all")
    lines.append("after  columns  voxels  beyond the field of view")
    for state in found.states:
        outside = "-" if state.outside is None else f"{100 * state.outside:.0f} %"
        lines.append(f"{state.step:5d}  {state.columns:7.3f}  {state.voxels:6.4f}  {outside}")
    lines.append("voxel MSE, mean (sd) median; silhouette IoU of do nothing")
    lines.append("steps  examples  do nothing              empty                   mean   IoU")
    for row in found.baselines:
        scores = "  ".join(
            f"{s.mean:.4f} ({s.sd:.4f}) {s.median:.4f}" for s in (row.do_nothing, row.empty)
        )
        lines.append(
            f"{row.steps:5d}  {row.examples:8d}  {scores}  {row.mean_image:.4f} "
            f"{row.silhouette_iou.mean:.2f}"
        )
    return lines


def _note(progress: GenerationProgress, steps: int, seconds: float) -> str:
    good = (progress.new - progress.new_failed) * steps
    return (
        f"{60.0 * good / max(seconds, 1e-3):.1f} good manipulations/min, "
        f"{len(progress.failures)} failed"
    )
