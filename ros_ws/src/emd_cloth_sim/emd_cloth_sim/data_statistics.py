"""What a data set holds: counts, failures, occupancy, and the scores of doing without a net."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emd_cloth_sim.generation_folder import PARTIAL, SETTINGS
from emd_core.cloth_sequence import ClothSequence
from emd_core.errors import InvalidInputError
from emd_core.sequence_reader import SequenceReader
from emd_core.sequence_shard import PATTERN, SequenceFailure, SequenceShard


@dataclass(frozen=True)
class Spread:
    """Mean, standard deviation and median of a score."""

    mean: float
    sd: float
    median: float

    @classmethod
    def of(cls, values: list[float]) -> Spread:
        """Summarise at least one value."""
        return cls(float(np.mean(values)), float(np.std(values)), float(np.median(values)))


@dataclass(frozen=True)
class Baseline:
    """Scores that need no net, over all sub-sequences of one length.

    Attributes:
        steps: Manipulations from the initial to the goal state.
        examples: Sub-sequences.
        do_nothing: Voxel MSE between the two states.
        empty: Voxel MSE between an empty grid and the goal.
        mean_image: Voxel MSE between the mean of all goals and the goal.
        silhouette_iou: Silhouette IoU between the two states.
    """

    steps: int
    examples: int
    do_nothing: Spread
    empty: Spread
    mean_image: float
    silhouette_iou: Spread


@dataclass(frozen=True)
class StateStatistics:
    """The states after a number of manipulations.

    Attributes:
        step: That number.
        columns: Share of the columns that hold cloth.
        voxels: Share of the voxels that do.
        outside: Share of the states of which a vertex is beyond [-1, 1] and wraps; None without
            vertices.
    """

    step: int
    columns: float
    voxels: float
    outside: float | None


@dataclass(frozen=True)
class DataStatistics:
    """What `inspect_data` finds.

    Attributes:
        asked: Sequences that were asked for; None if nothing tells.
        sequences: Those in the shards.
        waiting: Those done whose shard is not finished yet.
        failures: Those that failed, with step and reason.
        manipulations: In the shards.
        two_handed: Share of the manipulations with two hands.
        repeated: Manipulations that were simulated more than once, in shorter substeps.
        unsettled: Manipulations after which the cloth did not come to rest within the limit.
        crossed: Manipulations after which the cloth passes through itself at a place or two.
        states: One entry for each number of manipulations done.
        baselines: One entry for each number of steps.
        provenance: Of the first file.
    """

    asked: int | None
    sequences: int
    waiting: int
    failures: tuple[SequenceFailure, ...]
    manipulations: int
    two_handed: float
    repeated: int
    unsettled: int
    crossed: int
    states: tuple[StateStatistics, ...]
    baselines: tuple[Baseline, ...]
    provenance: dict[str, Any]

    @property
    def failed_share(self) -> float:
        """Share of the sequences tried that failed."""
        tried = self.sequences + self.waiting + len(self.failures)
        return len(self.failures) / tried if tried else 0.0

    def as_entry(self) -> dict[str, Any]:
        """Give it as JSON holds it."""
        return {**asdict(self), "failed_share": self.failed_share}


def inspect_data(directory: Path) -> DataStatistics:
    """Go through a data set, or the authors' files, sequence by sequence.

    Raises:
        InvalidInputError: If the directory holds no data or a file cannot be read.
    """
    waiting, failures = _unfinished(directory)
    finished = any(directory.glob("[!.]*.npz")) or not (directory / SETTINGS).exists()
    # A run that was stopped before its first shard has nothing to read yet.
    reader = SequenceReader([directory]) if finished else None
    sums = _Sums()
    if reader is not None:
        failures += reader.failures
        for sequence in reader:
            sums.add(sequence)
    return DataStatistics(
        asked=_asked(directory),
        sequences=sums.sequences,
        waiting=waiting,
        failures=tuple(sorted(failures, key=lambda failure: failure.index)),
        manipulations=sums.manipulations,
        two_handed=sums.two_handed / max(1, sums.manipulations),
        repeated=_count(directory, "attempts", lambda attempts: attempts > 1),
        unsettled=_count(directory, "settled", np.logical_not),
        crossed=_count(directory, "crossings", lambda crossings: crossings > 0),
        states=sums.states(),
        baselines=sums.baselines(),
        provenance=_provenance(reader),
    )


@dataclass
class _Sums:
    """What is added up over sequences; lists are indexed by step or number of steps."""

    sequences: int = 0
    manipulations: int = 0
    two_handed: int = 0
    counts: list[int] = field(default_factory=list)
    columns: list[float] = field(default_factory=list)
    voxels: list[float] = field(default_factory=list)
    outside: list[int] = field(default_factory=list)
    with_states: bool = True
    do_nothing: list[list[float]] = field(default_factory=list)
    silhouette: list[list[float]] = field(default_factory=list)
    empty: list[list[float]] = field(default_factory=list)
    goals: list[NDArray[np.float64]] = field(default_factory=list)

    def add(self, sequence: ClothSequence) -> None:
        """Add one sequence."""
        self.sequences += 1
        self.manipulations += len(sequence)
        self.two_handed += int(np.isfinite(sequence.picks).all(axis=(1, 2)).sum())
        grids = sequence.grids
        while len(self.counts) <= len(sequence):
            for numbers in (self.counts, self.columns, self.voxels, self.outside):
                numbers.append(0)  # type: ignore[arg-type]
            for scores in (self.do_nothing, self.silhouette, self.empty):
                scores.append([])
            self.goals.append(np.zeros(grids.shape[1:]))
        self._add_states(sequence, grids)
        for steps in range(1, len(grids)):
            self._add_examples(grids, steps)

    def _add_states(self, sequence: ClothSequence, grids: NDArray[np.bool_]) -> None:
        self.with_states &= sequence.states is not None
        for step, grid in enumerate(grids):
            self.counts[step] += 1
            self.columns[step] += float(grid.any(axis=2).mean())
            self.voxels[step] += float(grid.mean())
            if sequence.states is not None:
                self.outside[step] += int(np.abs(sequence.states[step, :, :2]).max() > 1.0)

    def _add_examples(self, grids: NDArray[np.bool_], steps: int) -> None:
        starts, goals = grids[:-steps], grids[steps:]
        first, last = starts.any(axis=3), goals.any(axis=3)
        union = (first | last).sum(axis=(1, 2))
        common = (first & last).sum(axis=(1, 2))
        self.do_nothing[steps] += (starts != goals).mean(axis=(1, 2, 3)).tolist()
        self.silhouette[steps] += np.where(union, common / np.maximum(union, 1), 1.0).tolist()
        self.empty[steps] += goals.mean(axis=(1, 2, 3)).tolist()
        self.goals[steps] += goals.sum(axis=0)

    def states(self) -> tuple[StateStatistics, ...]:
        """Means over the states after each number of manipulations."""
        return tuple(
            StateStatistics(
                step,
                self.columns[step] / count,
                self.voxels[step] / count,
                self.outside[step] / count if self.with_states else None,
            )
            for step, count in enumerate(self.counts)
        )

    def baselines(self) -> tuple[Baseline, ...]:
        """Scores for each number of steps."""
        found = []
        for steps in range(1, len(self.counts)):
            examples = len(self.empty[steps])
            mean = self.goals[steps] / examples
            found.append(
                Baseline(
                    steps,
                    examples,
                    Spread.of(self.do_nothing[steps]),
                    Spread.of(self.empty[steps]),
                    # The mean over 0 and 1 of (value - p)^2 is p (1 - p).
                    float((mean * (1.0 - mean)).mean()),
                    Spread.of(self.silhouette[steps]),
                )
            )
        return tuple(found)


def _unfinished(directory: Path) -> tuple[int, list[SequenceFailure]]:
    """Count the sequences whose shard is not finished, and give the failures among them."""
    waiting = 0
    failures: list[SequenceFailure] = []
    for path in sorted((directory / PARTIAL).glob("sequence_*.npz")):
        part = SequenceShard.read(path, ("indices",))
        waiting += len(part.arrays["indices"])
        failures += part.failures
    return waiting, failures


def _count(
    directory: Path, name: str, is_doubtful: Callable[[NDArray[Any]], NDArray[np.bool_]]
) -> int:
    """Count the manipulations whose entry in the array `name` is doubtful, where there is one."""
    total = 0
    for path in sorted(directory.glob(PATTERN)):
        try:
            arrays = SequenceShard.read(path, (name,)).arrays
        except InvalidInputError as err:
            if isinstance(err.__cause__, KeyError):
                continue  # imported data do not tell, and older ones not all
            raise
        total += int(is_doubtful(arrays[name]).sum())
    return total


def _asked(directory: Path) -> int | None:
    path = directory / SETTINGS
    try:
        return int(json.loads(path.read_text())["sequences"]) if path.exists() else None
    except (OSError, ValueError, KeyError, TypeError) as err:
        raise InvalidInputError(f"{path} cannot be read: {err}") from err


def _provenance(reader: SequenceReader | None) -> dict[str, Any]:
    if reader is None:
        return {}
    return {key: value for key, value in reader.files[0].meta.items() if key != "failures"}
