"""The commands of `./cell`. Heavy imports wait until their command is called."""

from __future__ import annotations

import json
import shlex
import signal
import subprocess
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from typer.core import TyperCommand

from emd_cell.camera_commands import add_commands as add_camera_commands
from emd_core.errors import CellError, ErrorCode

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="The EMD folding cell: cloth manipulation on ROS 2.",
)
console = Console(stderr=True)
ROOT = Path(sys.prefix).parent  # the checkout: `.venv` lies in it


@app.command()
def setup() -> None:
    """Set up or repair the environment, nothing else."""
    print("The environment is ready.")  # the bootstrap has done it before this is reached


@app.command(name="exec")
def exec_command() -> None:
    """Run a command inside the environment: ./cell exec -- COMMAND [ARGS]."""


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
            f"{report.final.voxel_mse:.4f} after {len(report.steps)} manipulation(s)"
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
) -> None:
    """Write manipulations that the console recorded as a data set to train on."""
    from emd_console.example_store import VERDICTS, export_examples
    from emd_core.errors import InvalidInputError

    if verdict not in VERDICTS:
        raise InvalidInputError(f"--verdict must be of {', '.join(VERDICTS)}, got {verdict!r}")
    count = export_examples(directory / "examples", out, verdict)
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


@app.command(
    add_help_option=False,
    context_settings={"ignore_unknown_options": True, "allow_extra_args": True},
)
def train(context: typer.Context) -> None:
    """Train a net on data sets and recorded manipulations; `--help` tells its options."""
    from emd_planner.train import main as run_training

    raise typer.Exit(run_training(context.args, "./cell train"))


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


@app.command(name="evaluate-cloth")
def evaluate_cloth(
    reference: Annotated[Path, typer.Option(help="folder of reference sequences (.npz)")],
    json_file: Annotated[Path, typer.Option("--json", help="figures of all manipulations")],
    preset: Annotated[str, typer.Option(help="the cloth and its hands' path")] = "reference",
    mesh: Annotated[int | None, typer.Option(min=5, help="vertices a side")] = None,
    workers: Annotated[int, typer.Option(min=1, help="processes")] = 2,
    half: Annotated[str, typer.Option(help="fit, held-out or all")] = "all",
    pictures: Annotated[
        Path | None, typer.Option(help="folder for a picture of best, median and worst")
    ] = None,
) -> None:
    """Replay reference sequences on our cloth and say how near it comes."""
    from emd_cell.evaluate_command import evaluate_folder

    mean = evaluate_folder(reference, json_file, preset, mesh, workers, half, pictures, console)
    print(json.dumps(mean, indent=1))
    print(f"written: {json_file}")


class _ManyValues(TyperCommand):
    """Options that may be given many values after one name: `--steps 1 2 3`."""

    many = ("--data", "--steps", "--planners", "--executed", "--judged")

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Repeat the option's name before each further value, as Click wants it."""
        repeated: list[str] = []
        name = ""
        for arg in args:
            is_further = name in self.many and not arg.startswith("-") and repeated[-1] != name
            repeated += [name, arg] if is_further else [arg]
            name = arg if arg.startswith("-") else name
        return super().parse_args(ctx, repeated)


@app.command(cls=_ManyValues)
def evaluate(
    json_file: Annotated[Path, typer.Option("--json", help="rows and records; .md, .png beside")],
    data: Annotated[
        list[Path] | None, typer.Option(help="sequences: folders, or the authors' npz; many")
    ] = None,
    neat: Annotated[bool, typer.Option("--neat", help="the neat folds instead of data")] = False,
    split: Annotated[str, typer.Option(help="all, train or test (a tenth)")] = "all",
    sequences: Annotated[int | None, typer.Option(min=1, help="at most so many")] = None,
    steps: Annotated[list[int] | None, typer.Option(help="1 2 3; many")] = None,
    mode: Annotated[str, typer.Option(help="replan (the paper's procedure) or open")] = "replan",
    planners: Annotated[
        list[str] | None,
        typer.Option(
            help="paper ours ours-simulated nothing empty random oracle oracle_perturbed; many"
        ),
    ] = None,
    preset: Annotated[str | None, typer.Option(help="the cloth; default: reference, or towel")] = (
        None
    ),
    mesh: Annotated[int, typer.Option(min=5, help="vertices a side")] = 41,
    weights: Annotated[Path | None, typer.Option(help="default: those shipped")] = None,
    reach: Annotated[
        str | None, typer.Option(help="plan within reach: cell (HIRO's arms), or half the view")
    ] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="default: all cores")] = None,
    seed: Annotated[int, typer.Option(min=0)] = 0,
) -> None:
    """Let planners fold in the cloth simulation and compare the outcomes; docs/evaluation.md."""
    import os

    from emd_cell.evaluation.command import evaluate_planners
    from emd_cell.evaluation.rivals import REACHES
    from emd_cell.evaluation.run import Evaluation
    from emd_cell.evaluation.tasks import neat_tasks, sequence_tasks
    from emd_cloth_sim.presets import preset as cloth_preset
    from emd_core.errors import InvalidInputError

    if bool(data) == neat:
        raise InvalidInputError("give either --data or --neat")
    cloth = cloth_preset(preset or ("towel" if neat else "reference"), (mesh, mesh))
    tasks = (
        neat_tasks(cloth.cloth)
        if neat
        else sequence_tasks(data or [], steps or [1, 2, 3], mesh, split, sequences)
    )
    names = tuple(planners or ["nothing", "paper", "ours"])
    if reach is not None and reach not in REACHES:
        raise InvalidInputError(f"--reach must be of {', '.join(REACHES)}, got {reach!r}")
    limits = None if reach is None else REACHES[reach]
    evaluation = Evaluation(tasks, names, mode, cloth, weights, limits, seed)
    count = workers or len(os.sched_getaffinity(0))
    print(evaluate_planners(evaluation, json_file, count, sys.argv[2:], console), end="")
    print(f"written: {json_file}")


@app.command(name="evaluate-net", cls=_ManyValues)
def evaluate_net(
    data: Annotated[list[Path], typer.Option(help="folders of ours or of the authors' npz; many")],
    json_file: Annotated[Path, typer.Option("--json", help="the rows")],
    steps: Annotated[list[int] | None, typer.Option(help="1 2 3; many")] = None,
    split: Annotated[str, typer.Option(help="all, train or test (a tenth)")] = "all",
    weights: Annotated[Path | None, typer.Option(help="default: those shipped")] = None,
) -> None:
    """Compare what the net foretells with what was recorded; docs/evaluation.md."""
    from emd_cell.evaluation.prediction import judge_net
    from emd_cloth_sim.json_file import write_json

    rows = judge_net(data, steps or [1, 2, 3], split, weights)
    write_json(json_file, {"command": shlex.join(["./cell", *sys.argv[1:]]), "rows": rows})
    for row in rows:
        print(
            f"{row['steps']} step(s), {row['n']} examples: voxel MSE {row['net']:.4f}, "
            f"{row['relative']:.3f} of do nothing's {row['do_nothing']:.4f} "
            f"(empty {row['empty']:.4f}, mean grid {row['mean']:.4f})"
        )
    print(f"written: {json_file}")


@app.command(name="fit-trust", cls=_ManyValues)
def fit_trust(
    executed: Annotated[
        list[Path], typer.Option(help="reports of `evaluate --mode open`, to learn from; many")
    ],
    json_file: Annotated[Path, typer.Option("--json", help="figures; .png beside")],
    judged: Annotated[
        list[Path] | None, typer.Option(help="other such reports, to judge by; many")
    ] = None,
    weights: Annotated[Path | None, typer.Option(help="default: those shipped")] = None,
) -> None:
    """Learn from executed plans which ones fail; docs/evaluation.md."""
    from emd_cell.evaluation.doubt import as_entry, draw, judge, read_executed
    from emd_cloth_sim.json_file import write_json
    from emd_planner import trust
    from emd_planner.weights import SHIPPED_WEIGHTS

    plans = read_executed(executed)
    command = shlex.join(["./cell", *sys.argv[1:]])
    model = trust.fit_trust([p.figures for p in plans], [p.failed for p in plans], command)
    reports = {"learned from": judge(model, plans)}
    if judged:
        reports["others"] = judge(model, read_executed(judged))
    model.save(weights or SHIPPED_WEIGHTS)
    entries = {name: as_entry(report) for name, report in reports.items()}
    write_json(json_file, {"command": command, "model": vars(model), "reports": entries})
    draw(reports, json_file.with_suffix(".png"))
    for name, report in reports.items():
        print(
            f"{name}: {report.failed} of {report.plans} plans failed; AUROC {report.auroc:.3f} "
            f"(expected error alone {report.auroc_of_expected_error:.3f}), Brier score "
            f"{report.brier:.3f} (always the share that failed: {report.brier_of_rate:.3f})"
        )
    print(f"written: {trust.trust_file(weights or SHIPPED_WEIGHTS)}, {json_file}")


@app.command()
def generate(
    sequences: Annotated[int, typer.Option(help="how many, failed ones included")],
    out: Annotated[Path, typer.Option(help="folder; the same command goes on after a kill")],
    steps: Annotated[int, typer.Option(help="manipulations in a sequence")] = 3,
    mesh: Annotated[int, typer.Option(help="vertices a side")] = 81,
    workers: Annotated[int | None, typer.Option(help="processes; default: all cores")] = None,
    seed: Annotated[int, typer.Option(help="of all sequences")] = 0,
    preset: Annotated[str, typer.Option(help="which cloth")] = "towel",
    mode: Annotated[str, typer.Option(help="any (the authors' rule), paper, hem, mixed, fold")] = (
        "any"
    ),
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


add_camera_commands(app, console)


@app.command()
def reach(
    robot: Annotated[Path | None, typer.Option(help="a robot's YAML; HIRO if none")] = None,
    folder: Annotated[Path, typer.Option(help="reach-<cell>.npz and .png")] = Path("runs/reach"),
) -> None:
    """Compute where each arm can grasp and let go, once for each cell; print the file's path."""
    from emd_cell.reach_command import write_reach_map

    print(write_reach_map(robot, folder, console))


@app.command(name="check-motion")
def check_motion(
    plans: Annotated[int, typer.Option(min=1, help="how many random manipulations")] = 1000,
    seed: Annotated[int, typer.Option(min=0, help="of the manipulations")] = 0,
    folder: Annotated[Path, typer.Option(help="journal.jsonl, summary.json")] = Path(
        "runs/motion"
    ),
    robot: Annotated[Path | None, typer.Option(help="a robot's YAML; HIRO if none")] = None,
    minutes: Annotated[float, typer.Option(min=0.0, help="stop after these; 0: never")] = 0.0,
) -> None:
    """Plan random manipulations and audit every motion: limits, collisions, straightness.

    An interrupted campaign goes on when the command is given again.
    """
    from emd_cell.motion_check.command import check_motion as check

    report = check(plans, seed, folder, robot, minutes, sys.argv[2:], console)
    print(json.dumps(report["summary"], indent=1))


@app.command(name="check-folds")
def check_folds(
    folds: Annotated[int, typer.Option(min=1, help="how many random goals")] = 50,
    seed: Annotated[int, typer.Option(min=0, help="of goals, noise and searches")] = 0,
    folder: Annotated[Path, typer.Option(help="journal.jsonl, summary.json, logs")] = Path(
        "runs/folds"
    ),
    fast: Annotated[bool, typer.Option("--fast", help="not held to real time")] = False,
) -> None:
    """Fold to random goals through all nodes and compare with folds without a robot.

    An interrupted run goes on when the command is given again.
    """
    from emd_cell.fold_check.command import FoldCheck
    from emd_cell.fold_check.command import check_folds as check

    report = check(FoldCheck(folds, seed, not fast), folder, sys.argv[2:], console)
    print(json.dumps(report["summary"], indent=1))


@app.command()
def bench(
    name: Annotated[str, typer.Argument(help="which; see --list")] = "",
    list_all: Annotated[bool, typer.Option("--list", help="list the benchmarks")] = False,
    json_file: Annotated[Path | None, typer.Option("--json", help="write the result")] = None,
    minutes: Annotated[
        float | None, typer.Option(min=0.1, help="console: for which memory is watched")
    ] = None,
) -> None:
    """Run a benchmark."""
    from emd_cell.bench import run_benchmark

    run_benchmark(ROOT, name, list_all, json_file, minutes)


@app.command()
def test(
    slow: Annotated[bool, typer.Option("--slow", help="also the slow ones")] = False,
    pytest_arguments: Annotated[
        list[str] | None, typer.Argument(help="passed to pytest, after --")
    ] = None,
) -> None:
    """Run ruff, mypy and all tests."""
    sources = ["ros_ws/src", "tests", "cell"]
    packages = sorted(str(path.parent) for path in ROOT.glob("ros_ws/src/*/*/py.typed"))
    commands = [
        ["ruff", "check", *sources],
        ["ruff", "format", "--check", *sources],
        ["mypy", *packages],
        ["pytest", *([] if slow else ["-m", "not slow"]), *(pytest_arguments or [])],
    ]
    failed = [
        command[0]
        for command in commands
        if subprocess.run([sys.executable, "-m", *command], cwd=ROOT).returncode != 0
    ]
    if failed:
        print(f"cell test: failed: {', '.join(failed)}", file=sys.stderr)
        raise typer.Exit(1)


@app.command()
def lock() -> None:
    """Write requirements.lock anew from requirements.in."""
    from emd_cell.lock import write_lock

    count = write_lock(ROOT / "requirements.in", ROOT / "requirements.lock")
    print(f"{count} packages in requirements.lock")


def main() -> int:
    """Run a command; a user's mistake is one line and status 2, a failure status 1."""
    for stop in (signal.SIGINT, signal.SIGTERM):  # also where a shell or container ignores SIGINT
        signal.signal(stop, signal.default_int_handler)
    try:
        app(prog_name="./cell")
    except CellError as err:
        command = sys.argv[1] if len(sys.argv) > 1 else ""
        print(f"cell {command}: {err}", file=sys.stderr)
        return 2 if err.code is ErrorCode.INVALID_INPUT else 1
    except KeyboardInterrupt:
        print("cell: interrupted", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
