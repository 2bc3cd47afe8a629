"""How near our cloth comes to reference sequences (`./cell evaluate-cloth`).

Every manipulation is replayed from the reference's own state before it, so that errors do not
pile up over a sequence. Our outcome is compared with the reference's beside two marks: doing
nothing, and the floor: the reference's own outcome when its grasp is moved by one vertex.
"""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.json_file import write_json
from emd_cloth_sim.manipulate import manipulate
from emd_cloth_sim.presets import ClothPreset
from emd_cloth_sim.reference_data import ReferenceCase
from emd_cloth_sim.replay import resample_sheet
from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView, FloatArray
from emd_core.manipulation import Manipulation
from emd_core.metrics import silhouette_iou, voxel_iou, voxel_mse
from emd_core.voxel_grid import voxelise

# Grids are made of normalised positions.
GRID = FieldOfView(half_extent=1.0)


@dataclass(frozen=True)
class Figures:
    """How far an outcome is from the reference's.

    Attributes:
        voxel_mse: Share of the voxels that differ.
        voxel_iou: Intersection over union of the occupied voxels.
        silhouette_iou: The same of the occupied columns.
        vertex_distance: Mean distance of corresponding vertices, normalised.
        vertex_distance_mm: The same for a cloth of 0.40 m.
    """

    voxel_mse: float
    voxel_iou: float
    silhouette_iou: float
    vertex_distance: float
    vertex_distance_mm: float


@dataclass(frozen=True)
class Pair:
    """Our outcome of one manipulation beside the reference's.

    Attributes:
        case: The manipulation.
        outcome: Our vertices after it, normalised, in the reference's resolution; those before
            it if the simulation failed.
        figures: Ours.
        do_nothing: Of the state before.
        floor: Of the perturbed reference, if known.
        failure: Why the simulation cannot be used; empty if it can.
        stretch_p99: 99th percentile of edge length over the step's rest length.
        crossings: Places where the cloth passes through itself, after and before. The reference
            lets it, so a start may have some.
        seconds: What the simulation took.
    """

    case: ReferenceCase
    outcome: FloatArray
    figures: Figures
    do_nothing: Figures
    floor: Figures | None
    failure: str
    stretch_p99: float
    crossings: tuple[int, int]
    seconds: float

    @property
    def relative_mse(self) -> float:
        """Voxel MSE over that of doing nothing; 0 if both are equal."""
        ours, idle = self.figures.voxel_mse, self.do_nothing.voxel_mse
        return ours / idle if idle > 0 else float(ours > 0)

    def as_entry(self) -> dict[str, Any]:
        """Give it as JSON holds it, without the vertices."""
        return {
            "file": self.case.file,
            "sequence": self.case.sequence,
            "step": self.case.step,
            "half": self.case.half,
            **asdict(self.figures),
            "relative_mse": self.relative_mse,
            "do_nothing": asdict(self.do_nothing),
            "floor": asdict(self.floor) if self.floor else None,
            "failure": self.failure,
            "stretch_p99": self.stretch_p99,
            "crossings": self.crossings[0],
            "crossings_before": self.crossings[1],
            "seconds": self.seconds,
        }


def compare(outcome: FloatArray, reference: FloatArray) -> Figures:
    """Compare two states of one mesh, shape (V, 3), normalised."""
    ours, wanted = voxelise(outcome, GRID), voxelise(reference, GRID)
    distance = float(np.linalg.norm(outcome - reference, axis=1).mean())
    return Figures(
        voxel_mse=voxel_mse(ours, wanted),
        voxel_iou=voxel_iou(ours, wanted),
        silhouette_iou=silhouette_iou(ours, wanted),
        vertex_distance=distance,
        vertex_distance_mm=1e3 * float(FieldOfView().table_from_normalised(distance)),
    )


def replay_case(case: ReferenceCase, preset: ClothPreset) -> Pair:
    """Perform a manipulation on our cloth, from the reference's state before it."""
    started = time.perf_counter()
    fov = FieldOfView()
    side = round(len(case.before) ** 0.5)
    start = resample_sheet(case.before, preset.cloth.vertices[0])
    cloth = Cloth.from_positions(fov.table_from_normalised(start), preset.cloth)
    crossings_before = cloth.check().crossings
    used = (bool(np.isfinite(case.picks[0]).all()), bool(np.isfinite(case.picks[1]).all()))
    values = np.concatenate([case.picks.ravel(), case.move])
    manipulation = Manipulation.from_network(values, used, fov)
    state = manipulate(cloth, manipulation, preset.path).diagnostics
    failure = "" if state.finite else state.failure
    outcome = case.before
    if state.finite:
        outcome = resample_sheet(fov.normalised_from_table(cloth.positions_in_table), side)
    return Pair(
        case=case,
        outcome=outcome,
        figures=compare(outcome, case.after),
        do_nothing=compare(case.before, case.after),
        floor=None if case.perturbed is None else compare(case.perturbed, case.after),
        failure=failure,
        stretch_p99=state.stretch_p99,
        crossings=(state.crossings, crossings_before),
        seconds=time.perf_counter() - started,
    )


def replay_cases(
    cases: Sequence[ReferenceCase],
    preset: ClothPreset,
    workers: int = 1,
    on_progress: Callable[[int, int], None] | None = None,
) -> list[Pair]:
    """Replay manipulations in `workers` processes; the pairs come in the order of the cases.

    Raises:
        InvalidInputError: If `workers` is below 1 or the preset's mesh is not square.
    """
    if workers < 1:
        raise InvalidInputError(f"workers must be at least 1, got {workers}")
    if preset.cloth.vertices[0] != preset.cloth.vertices[1]:
        raise InvalidInputError(
            f"the reference's mesh is square, got {preset.cloth.vertices}; use as many vertices "
            "along x as along y"
        )
    jobs = [(case, preset) for case in cases]
    if workers == 1:
        return _follow(map(_run, jobs), len(jobs), on_progress)
    # A spawned worker loads the kernels itself; forking after numba has started is not safe.
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        return _follow(pool.imap(_run, jobs), len(jobs), on_progress)


def summarise(pairs: Sequence[Pair]) -> dict[str, Any]:
    """Average the figures of pairs: ours, of doing nothing, and of the floor where it is known.

    `relative_mse` is the mean voxel MSE over the mean of doing nothing in the same pairs.

    Raises:
        InvalidInputError: If there is no pair.
    """
    if not pairs:
        raise InvalidInputError("there is no manipulation to average; check the folder and half")
    ours = _means([pair.figures for pair in pairs])
    idle = _means([pair.do_nothing for pair in pairs])
    known = [(pair.floor, pair) for pair in pairs if pair.floor is not None]
    floor = None
    if known:
        floor = _means([figures for figures, _ in known])
        idle_there = _means([pair.do_nothing for _, pair in known])
        floor["relative_mse"] = floor["voxel_mse"] / idle_there["voxel_mse"]
        floor["pairs"] = len(known)
    return {
        "pairs": len(pairs),
        "failures": sum(bool(pair.failure) for pair in pairs),
        "relative_mse": ours["voxel_mse"] / idle["voxel_mse"],
        **ours,
        "do_nothing": idle,
        "floor": floor,
    }


def _means(figures: Sequence[Figures]) -> dict[str, Any]:
    entries = [asdict(item) for item in figures]
    return {name: float(np.mean([entry[name] for entry in entries])) for name in entries[0]}


def _run(job: tuple[ReferenceCase, ClothPreset]) -> Pair:
    return replay_case(*job)


def _follow(
    results: Iterable[Pair], total: int, on_progress: Callable[[int, int], None] | None
) -> list[Pair]:
    pairs = []
    for pair in results:
        pairs.append(pair)
        if on_progress:
            on_progress(len(pairs), total)
    return pairs


def write_report(
    path: Path, pairs: Sequence[Pair], preset: ClothPreset, command: str
) -> dict[str, Any]:
    """Write the figures of all pairs and their means as JSON; gives the report.

    `mean` is over all pairs, `halves` over those of each half. The file appears whole or not at
    all.
    """
    halves = sorted({pair.case.half for pair in pairs})
    report = {
        "command": command,
        "config": asdict(preset),
        "mean": summarise(pairs),
        "halves": {
            half: summarise([pair for pair in pairs if pair.case.half == half]) for half in halves
        },
        "pairs": [pair.as_entry() for pair in pairs],
    }
    write_json(path, report)
    return report
