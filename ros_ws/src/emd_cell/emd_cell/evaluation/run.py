"""Evaluations on all cores, which can be killed and gone on with."""

from __future__ import annotations

import hashlib
import json
import multiprocessing
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import torch

from emd_cell.evaluation.execution import MODES, Record, perform
from emd_cell.evaluation.kept import as_shard
from emd_cell.evaluation.rivals import RIVALS, SIMULATED, Rival, make_rivals
from emd_cell.evaluation.tasks import Task
from emd_cell.journal import Journal
from emd_cloth_sim.presets import ClothPreset
from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray
from emd_planner.config import PLANNERS, ReachConfig
from emd_planner.weights import SHIPPED_WEIGHTS

Job = tuple[Task, str, str]


@dataclass(frozen=True)
class Evaluation:
    """What is evaluated.

    Attributes:
        tasks: What the planners are to do.
        planners: Their names; see `make_rivals`.
        mode: Of `MODES`; the trivial ones are the same in both.
        preset: The cloth that executes, and its hands' path.
        weights: Of the net; the shipped ones if None.
        reach: Where hands may go; None: anywhere.
        seed: Of all random numbers.
        keep: Folder that gets every executed plan as training data, beside those of other
            evaluations; None: none is kept.
    """

    tasks: list[Task]
    planners: tuple[str, ...]
    mode: str
    preset: ClothPreset
    weights: Path | None = None
    reach: ReachConfig | None = None
    seed: int = 0
    keep: Path | None = None

    def __post_init__(self) -> None:
        """Check mode and planners.

        Raises:
            InvalidInputError: If one is unknown.
        """
        if self.mode not in MODES:
            raise InvalidInputError(f"mode must be one of {', '.join(MODES)}, got {self.mode!r}")
        unknown = sorted(set(self.planners) - set(RIVALS))
        if unknown or not self.planners:
            raise InvalidInputError(f"planners must be of {', '.join(RIVALS)}, got {unknown}")

    @property
    def jobs(self) -> list[Job]:
        """All that is to be done."""
        return [(task, name, self.mode) for task in self.tasks for name in self.planners]

    @property
    def identity(self) -> str:
        """Hash of all that a record depends on but task and planner."""
        weights = self.weights or SHIPPED_WEIGHTS
        digest = hashlib.sha256(weights.read_bytes() if weights.exists() else b"")
        content = [asdict(self.preset), self.seed, self.mode, self.reach and asdict(self.reach)]
        content.append(
            {
                name: asdict(PLANNERS["ours" if name == SIMULATED else name])
                for name in self.planners
                if name in PLANNERS or name == SIMULATED
            }
        )
        digest.update(json.dumps(content, sort_keys=True).encode())
        for task in self.tasks:
            digest.update(task.name.encode() + task.start.tobytes() + task.goal.tobytes())
        return digest.hexdigest()


def evaluate(
    evaluation: Evaluation,
    journal: Path,
    workers: int = 1,
    on_progress: Callable[[int, int], None] | None = None,
) -> list[Record]:
    """Let every planner do every task; the records come in the order of the jobs.

    Args:
        evaluation: What is to be done.
        journal: File that keeps every record as soon as it is there. With an existing one of the
            same evaluation, what it holds is not done again.
        workers: Processes, one core each.
        on_progress: Told how many records are there, of how many.

    Raises:
        InvalidInputError: If the journal is another evaluation's, or of one that kept its plans
            elsewhere, the folder for plans cannot be made, or the worker count is not positive.
        ModelError: If the weights cannot be used.
    """
    if workers < 1:
        raise InvalidInputError(f"workers must be at least 1, got {workers}")
    run: dict[str, object] = {"identity": evaluation.identity}
    if evaluation.keep is not None:  # what was done without keeping it would be missing
        _make_folder(evaluation.keep)
        run["keep"] = str(evaluation.keep)
    jobs = evaluation.jobs
    kept = Journal(journal, run)
    known = {(r.task, r.planner): r for r in map(Record.from_entry, kept.records)}
    missing = [job for job in jobs if (job[0].name, job[1]) not in known]
    for record in _perform_all(evaluation, missing, workers):
        kept.append(record.as_entry())
        known[record.task, record.planner] = record
        if on_progress is not None:
            on_progress(len(known), len(jobs))
    return [known[task.name, name] for task, name, _ in jobs]


def final_state(evaluation: Evaluation, record: Record) -> FloatArray:
    """Do a record's task again, for its picture; gives the final mid-surface (V, 3), metres."""
    task = next(task for task in evaluation.tasks if task.name == record.task)
    rivals = make_rivals((record.planner,), evaluation.weights, evaluation.reach)
    return perform(
        task,
        record.planner,
        rivals[record.planner],
        record.mode,
        evaluation.preset,
        evaluation.seed,
        evaluation.reach,
    ).outcome


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as err:
        raise InvalidInputError(
            f"a folder for executed plans is wanted, {folder} cannot be one: {err}"
        ) from err


def _perform_all(evaluation: Evaluation, jobs: list[Job], workers: int) -> Iterator[Record]:
    worker = _Worker(replace(evaluation, tasks=[]), evaluation.identity[:8])
    if workers == 1:
        yield from map(worker, jobs)
        return
    # A spawned worker loads the kernels itself; forking after numba has started is not safe.
    with multiprocessing.get_context("spawn").Pool(workers, _start, (worker,)) as pool:
        yield from pool.imap_unordered(_work, jobs)


class _Worker:
    """Does one job after the other; makes the planners at the first one."""

    def __init__(self, evaluation: Evaluation, run: str) -> None:
        self._evaluation = evaluation
        self._run = run
        self._rivals: dict[str, Rival] = {}

    def __call__(self, job: Job) -> Record:
        task, name, mode = job
        about = self._evaluation
        if not self._rivals:
            self._rivals = make_rivals(about.planners, about.weights, about.reach)
        rival = self._rivals[name]
        done = perform(task, name, rival, mode, about.preset, about.seed, about.reach)
        if about.keep is not None and done.manipulations:
            shard = as_shard(task, done.states, done.manipulations, about.preset)
            shard.write(about.keep / f"shard_{self._run}_{task.name}_{name}.npz")
        return done.record


_worker: _Worker


def _start(worker: _Worker) -> None:
    """Take the work of a process, on one core."""
    global _worker
    torch.set_num_threads(1)
    np.seterr(all="ignore")
    _worker = worker


def _work(job: Job) -> Record:
    return _worker(job)
