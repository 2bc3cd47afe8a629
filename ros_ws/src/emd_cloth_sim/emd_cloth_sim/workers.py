"""Who simulates sequences on this machine: this process, or several that may be killed."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import traceback
from collections import deque
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait

from emd_cloth_sim.generation_config import GenerationConfig
from emd_cloth_sim.simulate_sequence import simulate_sequence
from emd_core.errors import CellError, InvalidInputError, SimulationError
from emd_core.sequence_shard import SequenceShard

MOST_DEATHS = 3
"""Workers that may die over one sequence before the generator gives up."""


def run_here(
    config: GenerationConfig, indices: Sequence[int]
) -> Generator[SequenceShard, None, None]:
    """Simulate one sequence after the other in this process."""
    for index in indices:
        yield simulate_sequence(config, index)


@dataclass(frozen=True)
class ProcessRunner:
    """Simulates sequences in processes of this machine, one core each.

    A process that dies (killed, out of memory) is replaced and its sequence begun again. The
    processes end when this one does, even when it is killed.

    Attributes:
        workers: How many, at least 1.
    """

    workers: int

    def __post_init__(self) -> None:
        """Check the number.

        Raises:
            InvalidInputError: If it is below 1.
        """
        if self.workers < 1:
            raise InvalidInputError(f"workers must be at least 1, got {self.workers}")

    def __call__(
        self, config: GenerationConfig, indices: Sequence[int]
    ) -> Generator[SequenceShard, None, None]:
        """Simulate; gives the sequences as they are done.

        Raises:
            SimulationError: If workers died `MOST_DEATHS` times over one sequence.
        """
        waiting = deque(indices)
        deaths: dict[int, int] = {}
        workers = [_Worker(config) for _ in range(min(self.workers, len(waiting)))]
        try:
            for worker in workers:
                worker.begin(waiting.popleft())
            while busy := {w.connection: w for w in workers if w.index is not None}:
                for connection in wait(list(busy)):
                    worker = busy[connection]  # type: ignore[index]
                    index = worker.index
                    assert index is not None
                    part = worker.result()
                    if part is None:
                        _count_death(deaths, index)
                        waiting.appendleft(index)
                        worker.stop()
                        workers.remove(worker)
                        worker = _Worker(config)
                        workers.append(worker)
                    if waiting:
                        worker.begin(waiting.popleft())
                    if part is not None:
                        yield part
        finally:
            for worker in workers:
                worker.stop()


class _Worker:
    """A process with a pipe to it."""

    def __init__(self, config: GenerationConfig) -> None:
        # Forking after numba has started its threads is not safe.
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self._process = context.Process(target=_work, args=(config, theirs), daemon=True)
        self._process.start()
        theirs.close()
        self.index: int | None = None

    def begin(self, index: int) -> None:
        """Give it a sequence to simulate."""
        self.index = index
        try:
            self.connection.send(index)
        except BrokenPipeError:
            pass  # it has died; `result` will tell

    def result(self) -> SequenceShard | None:
        """Give what it has simulated; None if it has died."""
        self.index = None
        try:
            result = self.connection.recv()
        except (EOFError, OSError):
            return None
        if isinstance(result, CellError):
            raise result
        assert isinstance(result, SequenceShard)
        return result

    def stop(self) -> None:
        """End the process; what it is at is lost."""
        self._process.terminate()
        self._process.join()
        self.connection.close()


def _work(config: GenerationConfig, connection: Connection) -> None:
    """Simulate what the pipe asks for, until it or the parent ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent gets it too, and stops its workers
    threading.Thread(target=_end_with_parent, daemon=True).start()
    while True:
        try:
            index = connection.recv()
        except EOFError:
            return
        connection.send(_simulate_or_error(config, index))


def _simulate_or_error(config: GenerationConfig, index: int) -> SequenceShard | CellError:
    try:
        return simulate_sequence(config, index)
    except CellError as err:
        return err
    except Exception:
        # Any other error is a mistake in the program; its text must reach the user.
        return SimulationError(f"sequence {index} cannot be made:\n{traceback.format_exc()}")


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def _count_death(deaths: dict[int, int], index: int) -> None:
    deaths[index] = deaths.get(index, 0) + 1
    if deaths[index] >= MOST_DEATHS:
        raise SimulationError(
            f"{MOST_DEATHS} workers died over sequence {index} (killed, or out of memory); use "
            "fewer workers, and start the same command again: it goes on where it was"
        )
