"""Commands that make data and train the net."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from emd_cell.commands.app import app, console


@app.command(
    add_help_option=False,
    context_settings={"ignore_unknown_options": True, "allow_extra_args": True},
)
def train(context: typer.Context) -> None:
    """Train a net on data sets and recorded manipulations; `--help` tells its options."""
    from emd_planner.train import main as run_training

    raise typer.Exit(run_training(context.args, "./cell train"))


@app.command()
def simulate(
    input: Annotated[Path, typer.Option(help="states, picks, moves (.npz)")],
    output: Annotated[Path, typer.Option(help="the same keys, our states")],
) -> None:
    """Replay picks and moves on our cloth, in the authors' format, without a robot."""
    from rich.progress import Progress

    from emd_cloth_sim.replay import replay_file

    with Progress(console=console) as progress:
        task = progress.add_task("manipulations", total=None)
        replay_file(
            input,
            output,
            on_progress=lambda done, total: progress.update(task, completed=done, total=total),
        )
    print(f"written: {output}")


@app.command()
def generate(
    sequences: Annotated[int, typer.Option(help="how many, failed ones included")],
    out: Annotated[Path, typer.Option(help="folder; the same command goes on after a kill")],
    steps: Annotated[int, typer.Option(help="manipulations in a sequence")] = 3,
    mesh: Annotated[int, typer.Option(help="vertices a side")] = 81,
    workers: Annotated[int | None, typer.Option(help="processes; default: all cores")] = None,
    seed: Annotated[int, typer.Option(help="of all sequences")] = 0,
    preset: Annotated[str, typer.Option(help="which cloth")] = "towel",
    mode: Annotated[
        str, typer.Option(help="any (the authors' rule), paper, hem, mixed, fold, neat")
    ] = "any",
    start: Annotated[str, typer.Option(help="flat, or random: a previous outcome")] = "flat",
    edge_only: Annotated[bool, typer.Option("--edge-only", help="grasp at the edge only")] = False,
    independent_hands: Annotated[
        bool, typer.Option("--independent-hands", help="each hand has its own displacement")
    ] = False,
    ray: Annotated[str | None, typer.Option(help="address of a Ray cluster, or auto")] = None,
) -> None:
    """Generate training sequences on the simulated cloth; docs/data_format.md."""
    import time

    from emd_cell.generate_command import choose_runner, describe, run_generate
    from emd_cloth_sim.generation_config import GenerationConfig
    from emd_cloth_sim.random_manipulation import ManipulationRule

    rule = ManipulationRule(mode, edge_only, independent_hands)
    config = GenerationConfig(sequences, steps, seed, preset, (mesh, mesh), rule, start)
    begun = time.monotonic()
    progress = run_generate(config, out, choose_runner(workers, ray), console)
    print(describe(progress, steps, time.monotonic() - begun))
    print(f"written: {out}")


@app.command(name="average-weights")
def average_weights(
    before: Annotated[Path, typer.Argument(help="the net that training started from")],
    after: Annotated[Path, typer.Argument(help="what it became")],
    out: Annotated[Path, typer.Option(help="weights to write (.safetensors)")],
    share: Annotated[float, typer.Option(help="of the second net, 0..1")] = 0.5,
) -> None:
    """Mix a net with the one it was trained on from; docs/training.md."""
    from emd_planner.average_weights import average_weights as average

    if kept := average(before, after, share, out):
        print(f"taken from {before} alone, as they do not fit: {', '.join(kept)}")
    print(f"written: {out}")


@app.command()
def inspect(
    directory: Annotated[Path, typer.Argument(help="a data set, or the authors' files")],
    sheet: Annotated[
        Path | None, typer.Option(help="picture; default: inspect.png in the directory")
    ] = None,
    rows: Annotated[int, typer.Option(min=0, help="sequences in the picture; 0: none")] = 8,
    json_file: Annotated[Path | None, typer.Option("--json", help="write all figures")] = None,
) -> None:
    """Tell what a data set holds: counts, failures, occupancy, baselines, a contact sheet."""
    from emd_cell.generate_command import report_lines, run_inspect, write_json

    statistics = run_inspect(directory, sheet, rows)
    print("\n".join(report_lines(statistics)))
    if json_file is not None:
        write_json(statistics, json_file)


@app.command(name="import-data")
def import_data(
    source: Annotated[Path, typer.Argument(help="file or directory of the authors' format")],
    out: Annotated[Path, typer.Option(help="new folder")],
) -> None:
    """Turn files of the paper's authors' generator into a data set."""
    from emd_cloth_sim.authors_files import import_authors_files

    print(f"{import_authors_files(source, out)} sequences written: {out}")


@app.command(name="export-data")
def export_data(
    directory: Annotated[Path, typer.Argument(help="a data set")],
    out: Annotated[Path, typer.Option(help="file (.npz)")],
) -> None:
    """Turn a data set into a file of the paper's authors' format."""
    from emd_cloth_sim.authors_files import export_authors_file

    print(f"{export_authors_file(directory, out)} sequences written: {out}")
