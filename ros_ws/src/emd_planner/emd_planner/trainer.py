"""The state of a training run: net, averaged weights, recipe, data, scores."""

from __future__ import annotations

import dataclasses
import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from emd_core.errors import InvalidInputError
from emd_planner.architectures import NetConfig, architecture_of, make_net
from emd_planner.augmentation import Examples, augment
from emd_planner.checkpoint import load_checkpoint, save_checkpoint
from emd_planner.dataset import SequenceSet
from emd_planner.planning_net import multiplies_bfloat16
from emd_planner.process_group import ProcessGroup
from emd_planner.recipe import Losses, make_recipe
from emd_planner.speed import SpeedMeter, count_operations
from emd_planner.training_config import TrainingConfig
from emd_planner.training_log import TrainingLog, draw_curve
from emd_planner.validation import Validator, mean_grid
from emd_planner.weights import load_net, save_net


@dataclass(frozen=True)
class Run:
    """What one training run is about.

    Attributes:
        out: Directory for everything that the run writes.
        minutes: Training time over all its interruptions; 0: not limited by time.
        iterations: Number of batches; 0: not limited by number.
        seed: Of the initial weights, the split and the augmentation.
        group: The processes that train, and the device of this one.
        start_from: Weights to start from instead of random ones.
        command: How the run was started, for its provenance.
        mix_share: Of each batch, the part taken from the sequences that were mixed in.
    """

    out: Path
    minutes: float = 0.0
    iterations: int = 0
    seed: int = 0
    group: ProcessGroup = ProcessGroup()
    start_from: Path | None = None
    command: str = ""
    mix_share: float = 0.25

    def __post_init__(self) -> None:
        """Check the range.

        Raises:
            InvalidInputError: If the share is not between 0 and 1.
        """
        if not 0.0 <= self.mix_share <= 1.0:
            raise InvalidInputError(f"mix_share must be in 0..1, got {self.mix_share}")

    def progress(self, iteration: int, seconds: float) -> float:
        """Give the part of the run that is over, 0..1."""
        by_number = iteration / self.iterations if self.iterations else 0.0
        by_time = seconds / (60.0 * self.minutes) if self.minutes else 0.0
        return max(by_number, by_time)


class Trainer:
    """The state of a training run; `train` drives it."""

    def __init__(
        self, data: SequenceSet, net_config: NetConfig, config: TrainingConfig, run: Run
    ) -> None:
        """Prepare a run, or go on with the one that the checkpoint in `run.out` belongs to.

        Raises:
            InvalidInputError: If the checkpoint belongs to another run, or the data are too few.
            ModelError: If the weights to start from do not fit.
        """
        self.config, self.run = config, run
        self.data_hash = data.content_hash
        self.train_set, held_out = data.split(config.validation_share, run.seed)
        average = mean_grid(self.train_set)
        self.validators = {
            name: Validator(held_out, average, steps, run.group.device)
            for name, steps in (("one_step", 1), ("two_steps", 2))
            if len(held_out.window_starts(steps))
        }
        self.net = make_net(net_config, run.seed)
        self.started_anew = []
        if run.start_from is not None:
            self.started_anew = _take_weights(self.net, load_net(run.start_from))
        self.net.to(run.group.device)
        if config.bfloat16 and multiplies_bfloat16(run.group.device):
            self.net.compute_type = torch.bfloat16
        self.average = {n: p.detach().clone() for n, p in self.net.named_parameters()}
        self.recipe = make_recipe(self.net, config, run.group)
        self.speed = SpeedMeter(run.group.device, self.net.compute_type)
        self._tensors = self.train_set.tensors.to(run.group.device)
        self.starts, self.mixed_starts = (
            torch.from_numpy(self.train_set.window_starts(1, mixed)).to(run.group.device)
            for mixed in (False, True)
        )
        self._require_examples(data)
        self.iteration, self.seconds = 0, 0.0
        self.recent: list[torch.Tensor] = []
        rows = self._resume() if self.checkpoint_path.exists() else []
        self.log = TrainingLog(run.out, rows) if run.group.leads else None

    @property
    def checkpoint_path(self) -> Path:
        """Where the run's state is kept."""
        return self.run.out / "checkpoint.pt"

    @property
    def identity(self) -> dict[str, Any]:
        """What must be the same for a checkpoint to be gone on with."""
        return {
            "architecture": architecture_of(self.net.config),
            "net": dataclasses.asdict(self.net.config),
            "training": dataclasses.asdict(self.config),
            "seed": self.run.seed,
            "data": self.data_hash,
            "length": [self.run.minutes, self.run.iterations],
            "processes": self.run.group.size,
            **({"mix": [len(self.mixed_starts), self.run.mix_share]} if self.mixes else {}),
        }

    @property
    def mixes(self) -> bool:
        """Whether sequences were mixed in."""
        return len(self.mixed_starts) > 0

    @property
    def manipulations_a_step(self) -> int:
        """How many manipulations all processes together train on in one step."""
        return self.config.batch_size * self.config.rollout_steps * self.run.group.size

    def step(self) -> None:
        """Train on one batch in each process."""
        begin = time.monotonic()
        progress = self.run.progress(self.iteration, self.seconds)
        progress = self.run.group.of_leader(progress)
        examples = self._batch()

        def learn() -> None:
            losses = Losses(self.net, examples, self.config.reconstruction_weight > 0.0)
            self.recipe.step(losses, progress)
            self.recent.append(losses.state.detach())

        if self.speed.knows_work:
            learn()
        else:
            self.speed.set_work(count_operations(learn))
        self.iteration += 1
        self._update_average()
        elapsed = time.monotonic() - begin
        self.speed.note(elapsed)
        self.seconds += elapsed

    def _batch(self) -> Examples:
        """Draw a batch that depends on seed, process and iteration only."""
        words = np.random.SeedSequence([self.run.seed, self.run.group.rank, self.iteration])
        generator = torch.Generator(self.run.group.device)
        generator.manual_seed(int(words.generate_state(1, np.uint32)[0]))
        windows = self._tensors.windows(self._draw_starts(generator), self.config.rollout_steps)
        return augment(windows, self.config.augmentation, generator)

    def _draw_starts(self, generator: torch.Generator) -> torch.Tensor:
        """Draw where a batch's windows begin; of those mixed in, as large a share as asked for."""
        shape, device = (self.config.batch_size,), generator.device

        def draw(starts: torch.Tensor) -> torch.Tensor:
            count = len(starts)
            return starts[torch.randint(count, shape, generator=generator, device=device)]

        starts = draw(self.starts)
        if not self.mixes:
            return starts
        mixed = draw(self.mixed_starts)
        taken = torch.rand(shape, generator=generator, device=device) < self.run.mix_share
        return torch.where(taken, mixed, starts)

    def _require_examples(self, data: SequenceSet) -> None:
        """Complain if what was mixed in is all held out, or all there is."""
        if data.mixed is not None and not (self.mixes and len(self.starts)):
            raise InvalidInputError(
                f"{int(data.mixed.sum())} of {len(data)} sequences are mixed in, which leaves "
                f"{len(self.mixed_starts)} manipulations of them and {len(self.starts)} others to "
                "train on; both are needed: give more data, or record more manipulations"
            )

    @torch.no_grad()
    def _update_average(self) -> None:
        # A short memory at first, so that the initial weights are soon forgotten.
        decay = min(self.config.average_decay, self.iteration / (self.iteration + 9.0))
        weights = [p.detach() for p in self.net.parameters()]
        torch._foreach_lerp_(list(self.average.values()), weights, 1.0 - decay)

    def validate(self) -> dict[str, float]:
        """Score the averaged weights on the held-out sequences, log and draw.

        For the process that leads.
        """
        assert self.log is not None
        steps_a_second, peak_share = self.speed.take()
        row = {
            "iteration": float(self.iteration),
            "seconds": self.seconds,
            "manipulations_per_s": steps_a_second * self.manipulations_a_step,
            "peak_share": peak_share,
            "train_loss_s": float(torch.stack(self.recent).mean()) if self.recent else math.nan,
        }
        self.recent.clear()
        with swapped_weights(self.net, self.average):
            for name, validator in self.validators.items():
                scores = validator.scores(self.net)
                row[name] = scores.net
                row[f"{name}_consistency"] = scores.consistency
                row[f"{name}_do_nothing"] = scores.do_nothing
                row[f"{name}_empty"] = scores.empty
                row[f"{name}_mean"] = scores.mean
        self.log.add(row)
        draw_curve(self.log.rows, self.run.out / "curve.png")
        return row

    def save(self) -> None:
        """Write the checkpoint, in the process that leads."""
        if self.log is None:
            return
        state = {
            "identity": self.identity,
            "net": self.net.state_dict(),
            "average": self.average,
            "recipe": self.recipe.state_dict(),
            "iteration": self.iteration,
            "seconds": self.seconds,
            "rows": self.log.rows,
        }
        save_checkpoint(self.checkpoint_path, state)

    def _resume(self) -> list[dict[str, float]]:
        state = load_checkpoint(self.checkpoint_path, self.identity)
        self.net.load_state_dict(state["net"])
        for name, value in state["average"].items():
            self.average[name].copy_(value)
        self.recipe.load_state_dict(state["recipe"])
        self.iteration, self.seconds = state["iteration"], state["seconds"]
        return state["rows"]

    def export(self) -> Path:
        """Write the averaged weights with their provenance, in the process that leads."""
        path = self.run.out / "emd_net.safetensors"
        if self.log is None:
            return path
        provenance = {
            "command": self.run.command,
            "seed": self.run.seed,
            "data_sha256": self.data_hash,
            "training_sequences": len(self.train_set),
            "training_manipulations": self.train_set.manipulation_count,
            "mixed_in": len(self.mixed_starts),
            "started_from": self.run.start_from and self.run.start_from.name,
            "started_anew": self.started_anew,
            "training": dataclasses.asdict(self.config),
            "iterations": self.iteration,
            "seconds": round(self.seconds, 1),
            "device": str(self.run.group.device),
            "processes": self.run.group.size,
            "torch": torch.__version__,
            "scores": self.log.rows[-1] if self.log.rows else {},
        }
        save_net(self.net, path, provenance, self.average)
        return path


@torch.no_grad()
def _take_weights(net: nn.Module, other: nn.Module) -> list[str]:
    """Copy the weights that fit; gives the names of those that begin anew.

    Raises:
        InvalidInputError: If none fits.
    """
    given, anew = other.state_dict(), []
    for name, weight in net.state_dict().items():
        if name in given and given[name].shape == weight.shape:
            weight.copy_(given[name])
        else:
            anew.append(name)
    if len(anew) == len(net.state_dict()):
        raise InvalidInputError(
            "none of the weights to start from fits the net; start from a net of the same kind"
        )
    return anew


class swapped_weights:  # noqa: N801 - reads as a statement
    """Context in which a net has other weights."""

    def __init__(self, net: nn.Module, weights: dict[str, torch.Tensor]) -> None:
        """Keep both."""
        self._net, self._weights = net, weights
        self._own: dict[str, torch.Tensor] = {}

    def __enter__(self) -> None:
        """Put the other weights in."""
        for name, parameter in self._net.named_parameters():
            self._own[name] = parameter.data
            parameter.data = self._weights[name]

    def __exit__(self, *_: object) -> None:
        """Put the net's own weights back."""
        for name, parameter in self._net.named_parameters():
            parameter.data = self._own[name]
