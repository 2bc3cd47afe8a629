"""Fit the reference preset: `python -m emd_cloth_sim.fit_reference --reference DIR --log FILE`.

Minimises the mean relative voxel MSE over manipulations of the fit half (see `reference_data`) by
scipy's Nelder-Mead simplex in the logarithms of the free parameters. The held-out half is never
read. Every evaluation is a line of the log; a run that finds its log takes known values from it,
so a run that was broken off goes on where it was.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize

from emd_cloth_sim.evaluate import replay_cases, summarise
from emd_cloth_sim.presets import ClothPreset, preset
from emd_cloth_sim.reference_data import FIT, ReferenceCase, load_cases
from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray

# Bounds of the free parameters, in the units of `ClothConfig`.
BOUNDS = {
    "stretch_compliance": (0.005, 0.2),
    "shear_compliance": (0.005, 0.4),
    "internal_damping": (0.0005, 0.05),
    "bending_rigidity": (5e-7, 5e-5),
    "desk_friction": (0.2, 1.5),
    "cloth_friction": (0.1, 1.5),
    "grasp_radius": (0.0060, 0.0110),
}
FIRST_STEP = 0.25


@dataclass(frozen=True)
class FitConfig:
    """What to fit to.

    Attributes:
        mesh: Vertices a side; a coarse mesh suffices for a search.
        every: Only every so many manipulations of the fit half are replayed.
        evaluations: Evaluations of the objective, those known from the log included.
        workers: Processes.
    """

    mesh: int = 41
    every: int = 6
    evaluations: int = 60
    workers: int = 1

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            InvalidInputError: If a value is out of its range.
        """
        if self.mesh < 5 or min(self.every, self.evaluations, self.workers) < 1:
            raise InvalidInputError(
                "mesh must be at least 5, and every, evaluations and workers at least 1, got "
                f"{self.mesh}, {self.every}, {self.evaluations} and {self.workers}"
            )


def with_parameters(start: ClothPreset, values: dict[str, float]) -> ClothPreset:
    """Give a preset with other free parameters."""
    return replace(start, cloth=replace(start.cloth, **values))  # type: ignore[arg-type]


class Objective:
    """The mean relative voxel MSE as a function of scaled logarithms, with a log on disk."""

    def __init__(self, cases: Sequence[ReferenceCase], config: FitConfig, log: Path) -> None:
        """Read what the log knows, if it is there."""
        self.cases = cases
        self.config = config
        self.log = log
        self.start = preset("reference", (config.mesh, config.mesh))
        self.settings = {"mesh": config.mesh, "cases": len(cases)}
        lines = log.read_text().splitlines() if log.exists() else []
        self.known = [entry for entry in map(json.loads, lines) if self._fits(entry)]

    def __call__(self, point: FloatArray) -> float:
        """Evaluate at a point; takes it from the log if it is there."""
        values = parameters_at(point)
        for entry in self.known:
            if entry["parameters"] == values:
                return float(entry["relative_mse"])
        pairs = replay_cases(self.cases, with_parameters(self.start, values), self.config.workers)
        mean = summarise(pairs)
        entry = {
            "relative_mse": mean["relative_mse"],
            "silhouette_iou": mean["silhouette_iou"],
            "parameters": values,
            **self.settings,
        }
        self.known.append(entry)
        self.log.parent.mkdir(parents=True, exist_ok=True)
        with self.log.open("a") as stream:
            stream.write(json.dumps(entry) + "\n")
        return float(entry["relative_mse"])

    def best(self) -> dict[str, Any]:
        """Give the best evaluation so far."""
        return min(self.known, key=lambda entry: float(entry["relative_mse"]))

    def _fits(self, entry: dict[str, Any]) -> bool:
        return all(entry.get(name) == value for name, value in self.settings.items())


def parameters_at(point: FloatArray) -> dict[str, float]:
    """Give the parameters at a point of logarithms, clipped to their bounds."""
    return {
        name: float(f"{min(max(math.exp(value), low), high):.6g}")
        for value, (name, (low, high)) in zip(point, BOUNDS.items(), strict=True)
    }


def fit(cases: Sequence[ReferenceCase], config: FitConfig, log: Path) -> dict[str, Any]:
    """Search from the preset's present parameters; gives the best evaluation."""
    objective = Objective(cases, config, log)
    cloth = objective.start.cloth
    first = np.log([getattr(cloth, name) for name in BOUNDS])
    simplex = np.vstack([first, first + FIRST_STEP * np.eye(len(first))])
    minimize(
        objective,
        first,
        method="Nelder-Mead",
        options={
            "initial_simplex": simplex,
            "maxfev": config.evaluations,
            "xatol": 0.02,
            "fatol": 0.001,
        },
    )
    return objective.best()


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    default = FitConfig()
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--reference", type=Path, required=True, help="folder of sequences")
    parser.add_argument("--log", type=Path, required=True, help="evaluations, JSON lines")
    parser.add_argument("--mesh", type=int, default=default.mesh, help="vertices a side")
    parser.add_argument("--every", type=int, default=default.every, help="thin out the cases")
    parser.add_argument("--evaluations", type=int, default=default.evaluations)
    parser.add_argument("--workers", type=int, default=default.workers, help="processes")
    options = parser.parse_args(arguments)
    config = FitConfig(options.mesh, options.every, options.evaluations, options.workers)
    cases = load_cases(options.reference, FIT)[:: config.every]
    print(json.dumps(fit(cases, config, options.log), indent=1))


if __name__ == "__main__":
    main()
