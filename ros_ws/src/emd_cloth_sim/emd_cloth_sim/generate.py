"""Generate training sequences: `python -m emd_cloth_sim.generate --sequences N --out DIR`.

A shard `shard_{index:05d}.npz` holds the sequences 16 * index to 16 * index + 15, less those whose
simulation failed:

- `grids` uint8 (N, L + 1, 2048): `np.packbits` of the occupancy (32, 32, 16) in C order, of the
  cloth's upper surface in the default field of view;
- `picks` float32 (N, L, 2, 2) and `moves` float32 (N, L, 2): normalised, unused hands NaN;
- `states` float16 (N, L + 1, V, 3): normalised mid-surface positions;
- `crossings` int16 (N, L): pairs of edge and triangle that intersect after every step;
- `seeds` int64 (N,): the sequence's index, which with the seed in `meta` determines it;
- `meta`: a JSON string: configs, mode, versions, seed, and the failures with their reasons.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numba
import numpy as np
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.config import ClothConfig, HandPathConfig
from emd_cloth_sim.manipulate import manipulate
from emd_cloth_sim.random_manipulation import MODES, random_manipulation
from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView
from emd_core.voxel_grid import voxelise

FORMAT = 1


@dataclass(frozen=True)
class GenerationConfig:
    """What to generate.

    Attributes:
        sequences: Sequences to simulate, at least 1; failed ones are not replaced.
        steps: Manipulations in a sequence, at least 1.
        mode: How manipulations are drawn, see `random_manipulation`.
        seed: Seed of all sequences; a sequence depends only on it and on its index.
        cloth: The cloth.
        path: How hands carry it.
        shard_size: Sequences in a file.
    """

    sequences: int
    steps: int
    mode: str
    seed: int
    cloth: ClothConfig
    path: HandPathConfig
    shard_size: int = 16

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            InvalidInputError: If a count or the seed is out of range or the mode unknown.
        """
        if min(self.sequences, self.steps, self.shard_size) < 1 or self.seed < 0:
            raise InvalidInputError(
                "sequences, steps and shard_size must be at least 1 and the seed at least 0, got "
                f"{self.sequences}, {self.steps}, {self.shard_size} and {self.seed}"
            )
        if self.mode not in MODES:
            raise InvalidInputError(f"mode must be one of {', '.join(MODES)}, got {self.mode!r}")


@dataclass(frozen=True)
class Sample:
    """One simulated sequence; `failure` says why it cannot be used, empty if it can."""

    index: int
    grids: np.ndarray
    picks: np.ndarray
    moves: np.ndarray
    states: np.ndarray
    crossings: np.ndarray
    failure: str


def simulate_sequence(config: GenerationConfig, index: int) -> Sample:
    """Simulate the sequence `index` from a flat, centred start; stops at a failed step."""
    rng = np.random.default_rng([config.seed, index])
    field_of_view = FieldOfView()
    cloth = Cloth(config.cloth)
    grids = [_packed_grid(cloth, field_of_view)]
    states = [field_of_view.normalised_from_table(cloth.positions_in_table)]
    actions = []
    crossings = []
    failure = ""
    for step in range(config.steps):
        manipulation = random_manipulation(cloth, config.mode, field_of_view, rng)
        outcome = manipulate(cloth, manipulation, config.path)
        failure = outcome.diagnostics.failure
        if failure:
            failure = f"step {step}: {failure}"
            break
        crossings.append(outcome.diagnostics.crossings)
        actions.append(manipulation.to_network(field_of_view))
        grids.append(_packed_grid(cloth, field_of_view))
        states.append(field_of_view.normalised_from_table(cloth.positions_in_table))
    values = np.array(actions).reshape(-1, 6)
    return Sample(
        index,
        np.stack(grids),
        values[:, :4].reshape(-1, 2, 2).astype(np.float32),
        values[:, 4:].astype(np.float32),
        np.stack(states).astype(np.float16),
        np.array(crossings, dtype=np.int16),
        failure,
    )


def shard_path(folder: Path, shard: int) -> Path:
    """Name of a shard's file."""
    return folder / f"shard_{shard:05d}.npz"


def generate_shard(config: GenerationConfig, shard: int, folder: Path) -> tuple[int, int]:
    """Simulate one shard and write it; returns how many sequences succeeded and failed."""
    first = shard * config.shard_size
    indices = range(first, min(first + config.shard_size, config.sequences))
    samples = [simulate_sequence(config, index) for index in indices]
    _write_shard(config, samples, shard_path(folder, shard))
    failed = sum(bool(sample.failure) for sample in samples)
    return len(samples) - failed, failed


def generate(config: GenerationConfig, folder: Path, workers: int = 1) -> tuple[int, int]:
    """Write all shards that are not there yet; returns how many new sequences succeeded, failed.

    Raises:
        InvalidInputError: If `workers` is below 1, or the folder holds shards of another config.
    """
    if workers < 1:
        raise InvalidInputError(f"workers must be at least 1, got {workers}")
    folder.mkdir(parents=True, exist_ok=True)
    shards = range(-(-config.sequences // config.shard_size))
    done = [shard for shard in shards if shard_path(folder, shard).exists()]
    for shard in done:
        _check_shard(config, shard, shard_path(folder, shard))
    jobs = [(config, shard, folder) for shard in shards if shard not in done]
    if workers == 1:
        return _follow(map(_run_job, jobs), len(shards), len(done))
    # A spawned worker compiles or loads the kernels itself; forking after numba has started its
    # threads is not safe.
    with multiprocessing.get_context("spawn").Pool(workers, _start_worker) as pool:
        return _follow(pool.imap_unordered(_run_job, jobs), len(shards), len(done))


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    options = _parser().parse_args(arguments)
    config = GenerationConfig(
        sequences=options.sequences,
        steps=options.steps,
        mode=options.mode,
        seed=options.seed,
        cloth=ClothConfig(vertices=(options.mesh, options.mesh)),
        path=HandPathConfig(),
    )
    generate(config, options.out, options.workers)


def _packed_grid(cloth: Cloth, field_of_view: FieldOfView) -> np.ndarray:
    return np.packbits(voxelise(cloth.top_surface_in_table, field_of_view).occupancy)


def _start_worker() -> None:
    numba.set_num_threads(1)


def _run_job(job: tuple[GenerationConfig, int, Path]) -> tuple[int, int]:
    return generate_shard(*job)


def _follow(results: Iterable[tuple[int, int]], shards: int, done: int) -> tuple[int, int]:
    """Show progress until all shards are written."""
    succeeded = failed = 0
    columns = (
        TextColumn("shards"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}"),
    )
    with Progress(*columns) as progress:
        task = progress.add_task("shards", total=shards, completed=done, note="")
        for new_succeeded, new_failed in results:
            succeeded += new_succeeded
            failed += new_failed
            rate = (succeeded + failed) / max(progress.tasks[0].elapsed or 0.0, 1e-3)
            note = f"{60 * rate:.1f} sequences/min, {failed} failed"
            progress.update(task, advance=1, note=note)
            if not progress.console.is_terminal:
                progress.console.print(f"{succeeded + failed} sequences, {note}")
    return succeeded, failed


def _meta(config: GenerationConfig) -> dict[str, Any]:
    """What the shards of one run have in common; `sequences` may grow in a later run."""
    values = asdict(config)
    del values["sequences"], values["shard_size"]
    versions = {"format": FORMAT, "numpy": np.__version__, "numba": numba.__version__}
    return json.loads(json.dumps({**values, "versions": versions}))


def _write_shard(config: GenerationConfig, samples: list[Sample], path: Path) -> None:
    kept = [sample for sample in samples if not sample.failure]
    failures = {str(sample.index): sample.failure for sample in samples if sample.failure}
    vertices = config.cloth.vertices[0] * config.cloth.vertices[1]
    steps = config.steps
    arrays: dict[str, Any] = {
        "grids": _stack([s.grids for s in kept], (steps + 1, 2048), np.uint8),
        "picks": _stack([s.picks for s in kept], (steps, 2, 2), np.float32),
        "moves": _stack([s.moves for s in kept], (steps, 2), np.float32),
        "states": _stack([s.states for s in kept], (steps + 1, vertices, 3), np.float16),
        "crossings": _stack([s.crossings for s in kept], (steps,), np.int16),
        "seeds": np.array([s.index for s in kept], dtype=np.int64),
        "meta": np.array(json.dumps({**_meta(config), "failures": failures})),
    }
    descriptor, temporary = tempfile.mkstemp(suffix=".tmp", dir=path.parent)
    try:
        with os.fdopen(descriptor, "wb") as stream:
            np.savez_compressed(stream, **arrays)
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def _stack(arrays: list[np.ndarray], shape: tuple[int, ...], dtype: type) -> np.ndarray:
    return np.stack(arrays) if arrays else np.empty((0, *shape), dtype)


def _check_shard(config: GenerationConfig, shard: int, path: Path) -> None:
    """Make sure that a shard found belongs to this run and holds as many sequences."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            meta = json.loads(str(stored["meta"]))
            found = len(stored["seeds"])
    except (OSError, KeyError, ValueError) as err:
        raise InvalidInputError(f"{path} should be a shard but cannot be read: {err}") from err
    found += len(meta.pop("failures", {}))
    wanted = min(config.shard_size, config.sequences - shard * config.shard_size)
    if meta != _meta(config) or found != wanted:
        raise InvalidInputError(
            f"{path} holds other settings or another number of sequences; use the same again, "
            "or another folder"
        )


def _parser() -> argparse.ArgumentParser:
    cloth = ClothConfig()
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--sequences", type=int, required=True, help="sequences to simulate")
    parser.add_argument("--steps", type=int, default=2, help="manipulations in a sequence")
    parser.add_argument("--mesh", type=int, default=cloth.vertices[0], help="vertices a side")
    parser.add_argument("--workers", type=int, default=1, help="processes")
    parser.add_argument("--seed", type=int, default=0, help="seed of all sequences")
    parser.add_argument("--out", type=Path, required=True, help="folder of the shards")
    parser.add_argument("--mode", choices=MODES, default="mixed", help="how hands are placed")
    return parser


if __name__ == "__main__":
    main()
