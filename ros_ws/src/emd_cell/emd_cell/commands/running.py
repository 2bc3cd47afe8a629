"""Commands that run the cell, or one part of it once."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from emd_cell.commands.app import app, console


@app.command()
def demo(
    goal: Annotated[
        str, typer.Option(help="half, diagonal, corner, ... or a grid (.npz)")
    ] = "half",
    steps: Annotated[int, typer.Option(min=0, max=6, help="0: as many as the fold needs")] = 0,
    seed: Annotated[int, typer.Option(min=0, help="camera noise and planner")] = 0,
    out: Annotated[Path, typer.Option(help="report.json, strip.png, fold.gif, logs")] = Path(
        "runs/demo"
    ),
    record: Annotated[Path | None, typer.Option(help="bag directory to record into")] = None,
    gui: Annotated[bool, typer.Option("--gui", help="open the simulator's window")] = False,
    real_time_factor: Annotated[
        float, typer.Option(min=0.0, help="simulated seconds a second; 0: as fast as possible")
    ] = 1.0,
) -> None:
    """A simulated HIRO folds a cloth; writes a report and pictures."""
    from emd_cell.demo import DemoOptions, run_demo

    options = DemoOptions(goal, out, steps, seed, record, gui, real_time_factor)
    report = run_demo(options, console)
    if report.initial and report.final:
        print(
            f"voxel MSE to the goal: {report.initial.voxel_mse:.4f} before, "
            f"{report.final.voxel_mse:.4f} after {report.carried_out} manipulation(s)"
        )
    print(f"report and pictures: {out}")
    if report.error:
        print(f"cell demo: {report.error['name']}: {report.error['message']}", file=sys.stderr)
        raise typer.Exit(1)


@app.command()
def up(
    gui: Annotated[bool, typer.Option("--gui", help="open the simulator's window")] = False,
    seed: Annotated[int, typer.Option(min=0, help="camera noise")] = 0,
    logs: Annotated[Path, typer.Option(help="directory of the nodes' logs")] = Path("runs/up"),
    real_time_factor: Annotated[float, typer.Option(min=0.0)] = 1.0,
    only: Annotated[
        list[str] | None, typer.Option(help="start only this node; repeatable")
    ] = None,
    listen: Annotated[
        str, typer.Option(help="console's address; beyond this machine it asks for tokens")
    ] = "127.0.0.1",
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="console's port, or the next free; 0: none")
    ] = 8765,
) -> None:
    """Start the cell with its console and leave it running until Ctrl-C."""
    from emd_cell.up import UpOptions, run_cell

    options = UpOptions(logs, gui, seed, real_time_factor, tuple(only or ()), listen, port)
    run_cell(options, console)


@app.command(name="console")
def console_command(
    listen: Annotated[
        str, typer.Option(help="address; beyond this machine it asks for tokens")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=1, max=65535, help="or the next free one")] = 8765,
    tokens: Annotated[
        bool, typer.Option("--tokens", help="ask for tokens on this machine, too")
    ] = False,
    directory: Annotated[Path, typer.Option(help="recordings and the log of commands")] = Path(
        "runs/console"
    ),
    reliable: Annotated[
        bool,
        typer.Option(help="ask for lost images again; --no-reliable for drivers that do not"),
    ] = True,
) -> None:
    """Serve the operator's console to any running cell, until Ctrl-C."""
    from emd_cell.console_command import run_console

    raise typer.Exit(run_console(listen, port, tokens, directory, reliable))


@app.command(name="export-examples")
def export_examples(
    out: Annotated[Path, typer.Option(help="new folder")],
    directory: Annotated[Path, typer.Option(help="the console's directory")] = Path(
        "runs/console"
    ),
    verdict: Annotated[str, typer.Option(help="accepted, undecided or rejected")] = "accepted",
    motions: Annotated[
        bool, typer.Option("--motions", help="copy the motions' bags, too")
    ] = False,
) -> None:
    """Write manipulations that the console recorded as a data set to train on."""
    from emd_console.example_store import VERDICTS, export_examples
    from emd_core.errors import InvalidInputError

    if verdict not in VERDICTS:
        raise InvalidInputError(f"--verdict must be of {', '.join(VERDICTS)}, got {verdict!r}")
    count = export_examples(directory / "examples", out, verdict, motions)
    print(f"{count} manipulations written: {out}")


@app.command(name="console-report")
def console_report(
    out: Annotated[Path, typer.Option(help="the HTML file to write")],
    directory: Annotated[Path, typer.Option(help="the console's directory")] = Path(
        "runs/console"
    ),
    run: Annotated[int | None, typer.Option(min=0, help="only this run; default: all")] = None,
) -> None:
    """Write what the console had done as one HTML file, pictures inside, to send around."""
    from emd_console.report import write_report

    count = write_report(directory, out, run)
    print(f"report on {count} run(s): {out}")


@app.command()
def perceive(
    color: Annotated[Path, typer.Option(help="colour image")],
    depth: Annotated[Path, typer.Option(help="depth image, registered: uint16 or float")],
    intrinsics: Annotated[
        tuple[float, float, float, float], typer.Option(metavar="FX FY CX CY", help="pixels")
    ],
    out: Annotated[Path, typer.Option(help="mask, voxel grid, overlay, summary")],
    depth_scale: Annotated[str, typer.Option(help="unit of the depth image: mm or m")] = "mm",
    half_extent: Annotated[
        float | None, typer.Option(help="metres of a normalised unit; default: the cell's")
    ] = None,
) -> None:
    """Find the cloth in image files and write its voxel grid."""
    from emd_perception.files import perceive_files

    summary = perceive_files(color, depth, intrinsics, depth_scale, out, half_extent)
    print(json.dumps(summary, indent=1))


@app.command()
def plan(
    initial: Annotated[Path, typer.Option(help="voxel grid (.npz) of the cloth now")],
    goal: Annotated[str, typer.Option(help="a neat fold's name or a voxel grid (.npz)")],
    steps: Annotated[int, typer.Option(min=0, max=6, help="0: the planner chooses")] = 1,
    seed: Annotated[int, typer.Option(min=0)] = 0,
    weights: Annotated[Path | None, typer.Option(help="default: those shipped")] = None,
    out: Annotated[Path | None, typer.Option(help="write the plan as JSON")] = None,
) -> None:
    """Plan manipulations between two voxel grids, without ROS."""
    from emd_cell.plan_command import plan_files

    entry = plan_files(initial, goal, steps, seed, weights, out)
    print(json.dumps(entry, indent=1))


@app.command()
def reach(
    robot: Annotated[Path | None, typer.Option(help="a robot's YAML; HIRO if none")] = None,
    folder: Annotated[Path, typer.Option(help="reach-<cell>.npz and .png")] = Path("runs/reach"),
) -> None:
    """Compute where each arm can grasp and let go, once for each cell; print the file's path."""
    from emd_cell.reach_command import write_reach_map

    print(write_reach_map(robot, folder, console))
