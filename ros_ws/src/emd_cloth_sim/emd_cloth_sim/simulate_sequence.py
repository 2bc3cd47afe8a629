"""Simulation of one random sequence; it depends on the configuration and its index only."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numba
import numpy as np
from llvmlite.binding import get_host_cpu_name
from numpy.typing import NDArray

from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.generation_config import GenerationConfig, provenance
from emd_cloth_sim.manipulate import ManipulationOutcome, manipulate
from emd_cloth_sim.neat_sequences import astray, draw_neat_fold
from emd_core.errors import SimulationError
from emd_core.frames import FieldOfView
from emd_core.independent_manipulation import HandsManipulation, IndependentManipulation
from emd_core.manipulation import Manipulation
from emd_core.sequence_shard import SequenceFailure, SequenceShard
from emd_core.voxel_grid import voxelise

MOST_BEFORE_START = 3


@dataclass
class _Recorder:
    """What is kept of a sequence while it runs."""

    field_of_view: FieldOfView = field(default_factory=FieldOfView)
    grids: list[NDArray[Any]] = field(default_factory=list)
    states: list[NDArray[Any]] = field(default_factory=list)
    picks: list[NDArray[Any]] = field(default_factory=list)
    moves: list[NDArray[Any]] = field(default_factory=list)
    crossings: list[int] = field(default_factory=list)
    settled: list[bool] = field(default_factory=list)
    attempts: list[int] = field(default_factory=list)

    def note_state(self, cloth: Cloth) -> None:
        """Keep how the cloth lies."""
        grid = voxelise(cloth.top_surface_in_table, self.field_of_view)
        self.grids.append(np.packbits(grid.occupancy))
        self.states.append(self.field_of_view.normalised_from_table(cloth.positions_in_table))

    def note_step(self, done: HandsManipulation, outcome: ManipulationOutcome) -> None:
        """Keep what was done."""
        points = done.grasp_points_in_table
        moves = (
            done.displacements_in_table
            if isinstance(done, IndependentManipulation)
            else done.displacement_in_table
        )
        self.picks.append(self.field_of_view.normalised_from_table(points))
        self.moves.append(self.field_of_view.normalised_from_table(moves))
        self.crossings.append(outcome.diagnostics.crossings)
        self.settled.append(outcome.settled)
        self.attempts.append(outcome.attempts)

    def arrays(self, index: int) -> dict[str, NDArray[Any]]:
        """Give the arrays of a shard with this one sequence."""
        return {
            "grids": np.array([self.grids], dtype=np.uint8),
            "states": np.array([self.states], dtype=np.float16),
            "picks": np.array([self.picks], dtype=np.float32),
            "moves": np.array([self.moves], dtype=np.float32),
            "crossings": np.array([self.crossings], dtype=np.int16),
            "settled": np.array([self.settled], dtype=bool),
            "attempts": np.array([self.attempts], dtype=np.uint8),
            "indices": np.array([index], dtype=np.int64),
        }


def simulate_sequence(config: GenerationConfig, index: int) -> SequenceShard:
    """Simulate the sequence `index`; gives a shard with it, or without it but with its failure."""
    numba.set_num_threads(1)  # sequences run beside each other, whoever simulates them
    rng = np.random.default_rng([config.seed, index])
    cloth = Cloth(config.material.cloth)
    recorder = _Recorder()
    failure = _bring_to_start(cloth, config, rng)
    if not failure:
        recorder.note_state(cloth)
        neat = draw_neat_fold(cloth.config, rng) if config.rule.mode == "neat" else []
        while not failure and len(recorder.moves) < config.steps:
            wanted = neat.pop(0) if neat else None
            failure = _perform(cloth, config, rng, recorder, wanted)
    processors = (get_host_cpu_name(),)
    if failure:
        # Steps before the first one were not recorded; see `SequenceFailure`.
        failed = SequenceFailure(index, len(recorder.states) - 1, failure)
        return SequenceShard(_empty(config), (failed,), provenance(config), processors)
    return SequenceShard(recorder.arrays(index), (), provenance(config), processors)


def _bring_to_start(cloth: Cloth, config: GenerationConfig, rng: np.random.Generator) -> str:
    """Perform the manipulations before a random start; says what failed, if anything did.

    The cloth itself goes on, not a copy of its positions, so that a cloth that remembers its
    creases does so here too.
    """
    before = 0 if config.start == "flat" else int(rng.integers(1, MOST_BEFORE_START + 1))
    for step in range(before):
        failure = _perform(cloth, config, rng, None)
        if failure:
            return f"manipulation {step + 1} of {before} before the start: {failure}"
    return ""


def _perform(
    cloth: Cloth,
    config: GenerationConfig,
    rng: np.random.Generator,
    recorder: _Recorder | None,
    wanted: Manipulation | None = None,
) -> str:
    """Draw one manipulation, or stray from a wanted one, and perform it; says what failed."""
    if wanted is None:
        drawn = config.rule.draw(cloth, FieldOfView(), rng)
    else:
        drawn = astray(wanted, cloth, FieldOfView(), rng)
    try:
        outcome = manipulate(cloth, drawn, config.material.path)
    except SimulationError as err:
        return str(err)
    if not outcome.diagnostics.failure and recorder is not None:
        recorder.note_step(drawn, outcome)
        recorder.note_state(cloth)
    return outcome.diagnostics.failure


def _empty(config: GenerationConfig) -> dict[str, NDArray[Any]]:
    """Give the arrays of a shard without sequences."""
    steps, count = config.steps, config.vertices[0] * config.vertices[1]
    moves = (2, 2) if config.rule.independent_hands else (2,)
    bits = int(np.prod(FieldOfView().size))
    return {
        "grids": np.empty((0, steps + 1, bits // 8), dtype=np.uint8),
        "states": np.empty((0, steps + 1, count, 3), dtype=np.float16),
        "picks": np.empty((0, steps, 2, 2), dtype=np.float32),
        "moves": np.empty((0, steps, *moves), dtype=np.float32),
        "crossings": np.empty((0, steps), dtype=np.int16),
        "settled": np.empty((0, steps), dtype=bool),
        "attempts": np.empty((0, steps), dtype=np.uint8),
        "indices": np.empty(0, dtype=np.int64),
    }
