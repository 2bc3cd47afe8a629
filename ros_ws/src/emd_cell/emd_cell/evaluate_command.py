"""`./cell evaluate-cloth`: the simulated cloth against reference sequences."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import MofNCompleteColumn, Progress, TimeElapsedColumn

from emd_cloth_sim.evaluate import replay_cases, write_report
from emd_cloth_sim.presets import preset
from emd_cloth_sim.reference_data import load_cases


def evaluate_folder(
    reference: Path,
    json_file: Path,
    preset_name: str,
    mesh: int | None,
    workers: int,
    half: str,
    pictures: Path | None,
    console: Console,
) -> dict[str, Any]:
    """Replay a folder's manipulations, write the figures and a picture, and give the means.

    Raises:
        InvalidInputError: If the folder, the preset, the mesh or the half cannot be used.
    """
    chosen = preset(preset_name, (mesh, mesh) if mesh else None)
    cases = load_cases(reference, half)
    columns = (*Progress.get_default_columns(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console) as progress:
        task = progress.add_task("manipulations", total=len(cases))
        pairs = replay_cases(
            cases, chosen, workers, lambda done, _: progress.update(task, completed=done)
        )
    arguments = ["--reference", str(reference), "--json", str(json_file)]
    arguments += ["--preset", preset_name, "--half", half, "--workers", str(workers)]
    arguments += ["--mesh", str(mesh)] if mesh else []
    arguments += ["--pictures", str(pictures)] if pictures else []
    report = write_report(
        json_file, pairs, chosen, shlex.join(["./cell", "evaluate-cloth", *arguments])
    )
    if pictures:
        from emd_cloth_sim.evaluation_picture import draw_examples

        draw_examples(pairs, pictures / "cloth_fidelity.png")
    mean: dict[str, Any] = report["mean"]
    return mean
