"""Commands that measure: planners, nets, cloth, arms, the whole cell."""

from __future__ import annotations

import json
import os
import shlex
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from emd_cell.commands.app import ROOT, app, console


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


class ManyValues(TyperCommand):
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


@app.command(cls=ManyValues)
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
    keep: Annotated[
        Path | None, typer.Option(help="folder for what was executed, as training data")
    ] = None,
) -> None:
    """Let planners fold in the cloth simulation and compare the outcomes; docs/evaluation.md."""
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
    evaluation = Evaluation(tasks, names, mode, cloth, weights, limits, seed, keep)
    count = workers or len(os.sched_getaffinity(0))
    print(evaluate_planners(evaluation, json_file, count, sys.argv[2:], console), end="")
    print(f"written: {json_file}")


@app.command(name="evaluate-net", cls=ManyValues)
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


@app.command(name="fit-trust", cls=ManyValues)
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


@app.command(name="check-motion")
def check_motion(
    plans: Annotated[int, typer.Option(min=1, help="how many random manipulations")] = 1000,
    seed: Annotated[int, typer.Option(min=0, help="of the manipulations")] = 0,
    folder: Annotated[Path, typer.Option(help="journal.jsonl, summary.json")] = Path(
        "runs/motion"
    ),
    robot: Annotated[Path | None, typer.Option(help="a robot's YAML; HIRO if none")] = None,
    minutes: Annotated[float, typer.Option(min=0.0, help="stop after these; 0: never")] = 0.0,
    workers: Annotated[int | None, typer.Option(min=1, help="default: all cores")] = None,
) -> None:
    """Plan random manipulations and audit every motion: limits, collisions, straightness.

    An interrupted campaign goes on when the command is given again.
    """
    from emd_cell.motion_check.command import check_motion as check

    count = workers or len(os.sched_getaffinity(0))
    report = check(plans, seed, folder, robot, minutes, count, sys.argv[2:], console)
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
