"""Train an EMD net: `./cell train --data DIR --out DIR --minutes 45`.

One run reads sequences, holds some out, trains, and writes to the output directory
`checkpoint.pt` (to go on after an interruption: start the same command again), `log.csv`,
`curve.png`, events for TensorBoard, and at the end `emd_net.safetensors` with `emd_net.json`.
`--mix DIR` takes a part of each batch (`--mix-share`) from recorded manipulations, as `./cell
export-examples` writes them; `--start-from` begins with the weights of the first phase.
`torchrun --nproc-per-node N -m emd_planner.train ...` trains on N devices, a batch on each.
"""

from __future__ import annotations

import argparse
import dataclasses
import signal
import sys
from collections.abc import Callable
from pathlib import Path

import torch
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from emd_core.errors import CellError, InvalidInputError
from emd_planner.architectures import ARCHITECTURES, NetConfig
from emd_planner.dataset import SequenceSet
from emd_planner.device import resolve_device
from emd_planner.memory import keep_freed_memory
from emd_planner.process_group import ProcessGroup, join_processes
from emd_planner.sequence_files import load_sequences
from emd_planner.trainer import Run, Trainer
from emd_planner.training_config import RECIPE_NETS, RECIPES, TrainingConfig

PROGRAM = "python -m emd_planner.train"
_MIX_HELP = "recorded manipulations, of which --mix-share of each batch are taken"


def train(
    data: SequenceSet,
    net_config: NetConfig,
    config: TrainingConfig,
    run: Run,
    on_row: Callable[[dict[str, float]], None] | None = None,
    on_step: Callable[[Trainer], None] | None = None,
    should_stop: Callable[[int], bool] | None = None,
) -> Path | None:
    """Train until the run's minutes or iterations are over.

    Args:
        data: All sequences; some are held out.
        net_config: Architecture.
        config: Recipe.
        run: Where, how long, from what seed.
        on_row: Called with each validation's row.
        on_step: Called after each batch.
        should_stop: Asked before each batch with the number of batches done; a run that stops
            writes a checkpoint and can go on later.

    Returns:
        The exported weights; None if the run was stopped.

    Raises:
        InvalidInputError: If the run has no end, or see `Trainer`.
    """
    if not (run.minutes > 0.0 or run.iterations > 0):
        raise InvalidInputError("a run needs minutes or iterations above 0, got neither")
    trainer = Trainer(data, net_config, config, run)
    validated = saved = trainer.seconds
    group = run.group
    while group.of_leader(run.progress(trainer.iteration, trainer.seconds)) < 1.0:
        if group.of_leader(should_stop is not None and should_stop(trainer.iteration)):
            trainer.save()
            return None
        trainer.step()
        if on_step is not None:
            on_step(trainer)
        if group.leads and trainer.seconds - validated >= config.validate_every:
            validated = trainer.seconds
            row = trainer.validate()
            if on_row is not None:
                on_row(row)
        if trainer.seconds - saved >= config.checkpoint_every:
            saved = trainer.seconds
            trainer.save()
    if group.leads and trainer.recent:
        row = trainer.validate()
        if on_row is not None:
            on_row(row)
    trainer.save()
    return trainer.export()


def main(arguments: list[str] | None = None, prog: str = PROGRAM) -> int:
    """Read the command line, train, and show how it goes.

    Args:
        arguments: Of the command line; the process's own if None.
        prog: How the command is called in its help.
    """
    options = _parse(arguments, prog)
    keep_freed_memory()
    group = ProcessGroup()
    console = Console()
    stopping: list[int] = []
    for name in (signal.SIGINT, signal.SIGTERM):
        signal.signal(name, lambda number, frame: stopping.append(number))
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeElapsedColumn(),
    )
    try:
        if options.threads:
            torch.set_num_threads(options.threads)
        group = join_processes(resolve_device(options.device))
        console.quiet = not group.leads
        data = load_sequences(options.data, split="train", mix=options.mix)
        console.print(f"{_contents(data)}; {_where(group)}")
        run = Run(
            options.out,
            options.minutes,
            options.iterations,
            options.seed,
            group,
            options.start_from,
            " ".join([PROGRAM, *(arguments or sys.argv[1:])]),
            options.mix_share,
        )
        with Progress(*columns, console=console) as progress:
            task = progress.add_task("training", total=1.0, rate="")

            def show(trainer: Trainer) -> None:
                done = trainer.iteration * trainer.manipulations_a_step / trainer.seconds
                rate = f"{done:.0f} manipulations/s"
                part = run.progress(trainer.iteration, trainer.seconds)
                progress.update(task, completed=part, rate=rate)

            weights = train(
                data,
                ARCHITECTURES[options.net or RECIPE_NETS[options.recipe]](),
                _training_config(options),
                run,
                on_row=lambda row: console.print(_describe(row)),
                on_step=show,
                should_stop=lambda iteration: bool(stopping),
            )
    except CellError as err:
        console.print(f"[red]error:[/red] {err}")
        return 1
    group.leave()
    if weights is None:
        console.print("stopped; the same command goes on from the checkpoint")
        return 130
    console.print(f"weights: {weights}")
    return 0


def _describe(row: dict[str, float]) -> str:
    text = (
        f"{row['iteration']:7.0f} it {row['seconds']:6.0f} s  {row['manipulations_per_s']:.0f} "
        f"manipulations/s ({row['peak_share']:.1%} of the device's peak)  train "
        f"{row['train_loss_s']:.4f}"
    )
    for name in ("one_step", "two_steps"):
        if name in row:
            text += (
                f"  {name} {row[name]:.4f} (nothing {row[f'{name}_do_nothing']:.4f}, "
                f"empty {row[f'{name}_empty']:.4f}, mean {row[f'{name}_mean']:.4f})"
            )
    return text


def _contents(data: SequenceSet) -> str:
    text = f"{len(data)} sequences, {data.manipulation_count} manipulations"
    if data.mixed is not None:
        text += f" ({int(data.lengths[data.mixed].sum())} of them mixed in)"
    if data.points is not None and data.pointless_count:
        text += (
            f", {data.pointless_count} without vertices and so neither turned freely nor missed"
        )
    return text


def _where(group: ProcessGroup) -> str:
    return str(group.device) if group.size == 1 else f"{group.size} processes on {group.device}"


def _training_config(options: argparse.Namespace) -> TrainingConfig:
    config = RECIPES[options.recipe]
    chosen = {
        name: getattr(options, name)
        for name in ("batch_size", "rollout_steps", "learning_rate")
        if getattr(options, name) is not None
    }
    augmentation = {
        name: getattr(options, name)
        for name in ("free_share", "near_miss_share", "translation_voxels")
        if getattr(options, name) is not None
    }
    chosen["augmentation"] = dataclasses.replace(config.augmentation, **augmentation)
    return dataclasses.replace(config, **chosen)


def _parse(arguments: list[str] | None, prog: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog=prog, description=__doc__)
    parser.add_argument("--data", type=Path, nargs="+", required=True, metavar="DIR")
    parser.add_argument("--mix", type=Path, nargs="+", default=[], metavar="DIR", help=_MIX_HELP)
    parser.add_argument("--mix-share", type=float, default=Run.mix_share, help="of a batch, 0..1")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")
    parser.add_argument("--net", choices=sorted(ARCHITECTURES), help="default: the recipe's own")
    parser.add_argument("--recipe", choices=sorted(RECIPES), default="ours")
    parser.add_argument("--minutes", type=float, default=0.0, help="of training, in all")
    parser.add_argument("--iterations", type=int, default=0, help="batches, in all")
    parser.add_argument("--device", default="auto", help="auto, cpu or cuda")
    parser.add_argument("--threads", type=int, default=0, help="0: as torch chooses")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--start-from", type=Path, metavar="WEIGHTS", help="a .safetensors")
    parser.add_argument("--batch-size", type=int)
    parser.add_argument("--rollout-steps", type=int)
    parser.add_argument("--learning-rate", type=float)
    parser.add_argument("--free-share", type=float, help="turned by any angle; needs vertices")
    parser.add_argument("--near-miss-share", type=float, help="beside the cloth; needs vertices")
    parser.add_argument("--translation-voxels", type=int)
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
