"""Cloth of known shape for synthetic scenes: flat, neatly folded, crumpled."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.manipulate import manipulate
from emd_cloth_sim.neat_folds import neat_fold
from emd_cloth_sim.random_manipulation import ManipulationRule
from emd_core.errors import SimulationError
from emd_core.frames import FieldOfView, FloatArray
from emd_core.independent_manipulation import HandsManipulation

SHAPES = ("flat", "half", "quarter", "diagonal", "thirds", "crumpled")
_SHARES = (0.15, 0.2, 0.2, 0.1, 0.05, 0.3)


@dataclass(frozen=True)
class ClothState:
    """A cloth at rest on the table.

    Attributes:
        shape: Of `SHAPES`.
        config: The sheet.
        positions: Mid-surface, shape (V, 3), metres, table frame.
        triangles: Shape (T, 3).
    """

    shape: str
    config: ClothConfig
    positions: FloatArray
    triangles: NDArray[np.int32]

    @property
    def positions_in_table(self) -> FloatArray:
        """The mid-surface, as a renderer asks for it."""
        return self.positions

    @property
    def thickness(self) -> float:
        """Of the sheet, metres."""
        return self.config.thickness

    @property
    def top_surface(self) -> FloatArray:
        """What a camera sees of it from above, shape (V, 3), metres."""
        return self.positions + np.array([0.0, 0.0, 0.5 * self.config.thickness])

    def layers_at(self, places: FloatArray) -> NDArray[np.int64]:
        """Count the layers over places of the table.

        Args:
            places: Shape (P, 2), metres.

        Returns:
            Shape (P,).
        """
        corners = self.positions[self.triangles][..., :2]
        count = np.zeros(len(places), dtype=np.int64)
        low, high = corners.min(axis=1), corners.max(axis=1)
        for index, place in enumerate(places):
            near = ((low <= place) & (place <= high)).all(axis=1)
            count[index] = _inside(place, corners[near]).sum()
        return count


def draw_state(rng: np.random.Generator, config: ClothConfig) -> ClothState:
    """Draw a shape, let it lie turned and shifted anywhere near the middle of the table.

    Folds are made by simulated hands, so their layers are not ideal.

    Raises:
        SimulationError: If a fold fails.
    """
    shape = str(rng.choice(SHAPES, p=_SHARES))
    while True:
        cloth = Cloth(config)
        try:
            for manipulation in _to_make(shape, cloth, rng):
                failure = manipulate(cloth, manipulation).diagnostics.failure
                if failure:
                    raise SimulationError(failure)
            break
        except SimulationError:
            # Crumpling may end in what the simulation itself does not believe: draw again.
            if shape != "crumpled":
                raise
    positions = _laid(cloth.positions_in_table, rng)
    return ClothState(shape, config, positions, cloth.triangles)


def _to_make(shape: str, cloth: Cloth, rng: np.random.Generator) -> Iterator[HandsManipulation]:
    """Give what hands do to a flat cloth; a random one is drawn when it is its turn."""
    if shape == "flat":
        return
    if shape != "crumpled":
        yield from neat_fold(shape, cloth.config).manipulations
        return
    rule = ManipulationRule("any", False, False)
    for _ in range(int(rng.integers(1, 3))):
        yield rule.draw(cloth, FieldOfView(), rng)


def _laid(positions: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Turn by any angle about the middle, and bring the middle near that of the table."""
    angle = rng.uniform(0.0, 2.0 * math.pi)
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    middle = 0.5 * (positions[:, :2].min(axis=0) + positions[:, :2].max(axis=0))
    laid = positions.copy()
    laid[:, :2] = (positions[:, :2] - middle) @ turn.T + rng.uniform(-0.03, 0.03, 2)
    return laid


def _inside(place: FloatArray, corners: FloatArray) -> NDArray[np.bool_]:
    """Whether a place lies in each triangle (T, 3, 2); a border belongs to one side only."""
    ahead = np.roll(corners, -1, axis=1)
    above, ahead_above = corners[..., 1] > place[1], ahead[..., 1] > place[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (place[1] - corners[..., 1]) / (ahead[..., 1] - corners[..., 1])
    crossing = corners[..., 0] + share * (ahead[..., 0] - corners[..., 0])
    hits = (above != ahead_above) & (place[0] < crossing)
    return np.asarray(hits.sum(axis=1) % 2 == 1)
