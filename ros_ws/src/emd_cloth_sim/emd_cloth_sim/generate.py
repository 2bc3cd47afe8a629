"""Generation of training sequences: resumable, and the same whoever simulates them."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from emd_cloth_sim.generation_config import GenerationConfig
from emd_cloth_sim.generation_folder import GenerationFolder
from emd_cloth_sim.workers import run_here
from emd_core.sequence_shard import SequenceFailure, SequenceShard

Runner = Callable[[GenerationConfig, Sequence[int]], Generator[SequenceShard, None, None]]
"""Simulates sequences by their indices and gives each, as a shard of one, in any order."""


@dataclass(frozen=True)
class GenerationProgress:
    """How far a data set has come.

    Attributes:
        asked: Sequences that were asked for.
        done: Those that are there, failed ones too.
        new: Those among them that this run has simulated.
        new_failed: Those among the new ones that failed.
        failures: Those that failed, in the order in which that became known.
    """

    asked: int
    done: int
    new: int
    new_failed: int
    failures: tuple[SequenceFailure, ...]


def generate(
    config: GenerationConfig,
    folder: Path,
    run: Runner = run_here,
    on_progress: Callable[[GenerationProgress], None] | None = None,
) -> GenerationProgress:
    """Simulate the sequences that the folder lacks and write them.

    Started again after a kill it goes on where it was; the files are then, byte for byte, those of
    a run without interruption, with any runner (on one kind of processor). A data set may grow:
    ask for more sequences in the same folder.

    Args:
        config: What to generate.
        folder: Where to; see `emd_cloth_sim.generation_folder`.
        run: Who simulates: `workers.run_here`, `workers.ProcessRunner`, `ray_workers.RayRunner`.
        on_progress: Called at the start and after each sequence.

    Returns:
        The data set at the end; its failures are those of earlier runs too.

    Raises:
        BusyError: If another process generates into the folder.
        InvalidInputError: If the folder belongs to another data set or a file cannot be read.
        SimulationError: If workers die again and again.
    """
    with GenerationFolder(folder, config) as target:
        missing = target.missing
        begun, failed = len(target.done), len(target.failures)

        def progress() -> GenerationProgress:
            failures = tuple(target.failures)
            done = len(target.done)
            return GenerationProgress(
                config.sequences, done, done - begun, len(failures) - failed, failures
            )

        if on_progress is not None:
            on_progress(progress())
        if missing:
            with closing(run(config, missing)) as parts:
                for part in parts:
                    target.add(part)
                    if on_progress is not None:
                        on_progress(progress())
        return progress()
