"""Simulation of sequences on a Ray cluster; Ray is an optional extra (docs/data_format.md)."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import Any

from emd_cloth_sim.generation_config import GenerationConfig
from emd_cloth_sim.simulate_sequence import simulate_sequence
from emd_core.errors import InvalidInputError, SimulationError
from emd_core.sequence_shard import SequenceShard

MOST_RETRIES = 20
"""Times that a sequence is begun again because its node or process was lost."""


@dataclass(frozen=True)
class RayRunner:
    """Simulates sequences on all cores of a Ray cluster, nodes that join later included.

    The nodes need this program in the same version, numpy, scipy and numba, but no common disk:
    sequences come back to the process that asks for them. What a lost node was at, and results
    that were only there, are simulated again elsewhere.

    Attributes:
        address: Of the cluster: `host:port`, or `auto` for the one that this machine belongs to.
    """

    address: str

    def __call__(
        self, config: GenerationConfig, indices: Sequence[int]
    ) -> Generator[SequenceShard, None, None]:
        """Simulate; gives the sequences as they are done.

        Raises:
            InvalidInputError: If Ray is not installed or the cluster does not answer.
            SimulationError: If a sequence was lost again and again, or a worker raised.
        """
        ray = _import_ray()
        mine = not ray.is_initialized()
        if mine:
            _connect(ray, self.address)
        try:
            yield from _simulate_all(ray, config, indices)
        finally:
            if mine:
                ray.shutdown()


def _simulate_all(
    ray: Any, config: GenerationConfig, indices: Sequence[int]
) -> Generator[SequenceShard, None, None]:
    simulate = ray.remote(num_cpus=1, max_retries=MOST_RETRIES)(simulate_sequence)
    shared = ray.put(config)
    waiting = deque(indices)
    running: dict[Any, int] = {}
    while waiting or running:
        while waiting and len(running) < _places(ray):
            index = waiting.popleft()
            running[simulate.remote(shared, index)] = index
        ready, _ = ray.wait(list(running), num_returns=1)
        for reference in ready:
            index = running.pop(reference)
            try:
                part: SequenceShard = ray.get(reference)
            except ray.exceptions.RayError as err:
                raise SimulationError(
                    f"the Ray cluster could not simulate sequence {index}: {err}; start the same "
                    "command again when it can: it goes on where it was"
                ) from err
            yield part


def _places(ray: Any) -> int:
    """Sequences to have under way: two a core, so that no core waits for the next one."""
    return 2 * max(1, int(ray.cluster_resources().get("CPU", 1)))


def _connect(ray: Any, address: str) -> None:
    try:
        ray.init(address=address, log_to_driver=False, logging_level="ERROR")
    except (ConnectionError, RuntimeError, ValueError, OSError) as err:
        raise InvalidInputError(
            f"no Ray cluster answers at {address}: {err}; start one with `ray start --head`"
        ) from err


def _import_ray() -> Any:
    try:
        import ray
        import ray.exceptions
    except ImportError as err:
        raise InvalidInputError(
            "a Ray cluster needs the optional extra: `pip install -r requirements-ray.txt`"
        ) from err
    return ray
