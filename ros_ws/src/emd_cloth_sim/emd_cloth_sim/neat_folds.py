"""Neat folds as goals: how to make them from a flat cloth, and what they ideally look like."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.mesh import flat_positions
from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView, FloatArray
from emd_core.manipulation import Manipulation
from emd_core.voxel_grid import VoxelGrid, voxelise

NEAT_FOLDS = ("half", "half_left", "diagonal", "corner", "quarter", "double_corner", "thirds")


@dataclass(frozen=True)
class NeatFold:
    """A fold that people ask for, from a flat, centred, axis-parallel cloth.

    Attributes:
        name: One of `NEAT_FOLDS`.
        manipulations: What the hands do, in order.
        goal_positions: Ideal mid-surface: the flat vertices reflected over the crease lines,
            layers stacked at the cloth's thickness; shape (V, 3), metres, table frame.
        cloth_config: The cloth that is folded.
    """

    name: str
    manipulations: tuple[Manipulation, ...]
    goal_positions: FloatArray
    cloth_config: ClothConfig

    def goal_grid(self, field_of_view: FieldOfView | None = None) -> VoxelGrid:
        """Voxelise the ideal upper surface."""
        raised = self.goal_positions + np.array([0.0, 0.0, 0.5 * self.cloth_config.thickness])
        return voxelise(raised, field_of_view)


def neat_fold(name: str, cloth_config: ClothConfig | None = None) -> NeatFold:
    """Look a fold up by its name.

    Raises:
        InvalidInputError: If there is no fold of that name.
    """
    config = cloth_config or ClothConfig()
    if name not in NEAT_FOLDS:
        raise InvalidInputError(f"a fold must be one of {', '.join(NEAT_FOLDS)}, got {name!r}")
    manipulations = _manipulations(name, *config.side_lengths)
    positions = flat_positions(config.vertices, config.side_lengths)
    layers = np.zeros(len(positions), dtype=np.int64)
    for manipulation in manipulations:
        positions, layers = _fold(positions, layers, manipulation, max(config.spacing))
    positions[:, 2] = (layers + 0.5) * config.thickness
    return NeatFold(name, manipulations, positions, config)


def goal_grid(name: str, config: ClothConfig, field_of_view: FieldOfView) -> VoxelGrid:
    """Voxelise the ideal upper surface of a fold; see `NeatFold.goal_grid`."""
    return neat_fold(name, config).goal_grid(field_of_view)


def _manipulations(name: str, side_x: float, side_y: float) -> tuple[Manipulation, ...]:
    """The far side has x < 0, the left side y < 0 (the robot and the camera look from x > 0)."""
    x, y = 0.5 * side_x, 0.5 * side_y
    none = (np.nan, np.nan)
    far_side = ((-x, -y), (-x, y))
    recipes: dict[str, list[tuple[Any, Any]]] = {
        "half": [(far_side, (2 * x, 0))],
        "half_left": [(((-x, -y), (x, -y)), (0, 2 * y))],
        "diagonal": [(((-x, -y), none), (2 * x, 2 * y))],
        "corner": [(((-x, -y), none), (x, y))],
        "quarter": [(far_side, (2 * x, 0)), (((0, -y), (x, -y)), (0, 2 * y))],
        "double_corner": [(((-x, -y), none), (x, y)), (((-x, y), none), (x, -y))],
        "thirds": [
            (far_side, (4 * x / 3, 0)),
            (((x, -y), (x, y)), (-4 * x / 3, 0)),
        ],
    }
    return tuple(
        Manipulation(np.array(points, dtype=np.float64), np.array(move, dtype=np.float64))
        for points, move in recipes[name]
    )


def _fold(
    positions: FloatArray, layers: np.ndarray, manipulation: Manipulation, spacing: float
) -> tuple[FloatArray, np.ndarray]:
    """Reflect what lies on the hands' side of the crease and lay it on what lies beneath.

    The crease is half-way between grasp and release, at right angles to the displacement.
    """
    displacement = manipulation.displacement_in_table
    normal = displacement / np.linalg.norm(displacement)
    grasp = manipulation.grasp_points_in_table[manipulation.used.index(True)]
    beyond = (grasp + 0.5 * displacement - positions[:, :2]) @ normal
    moved = beyond > 1e-9
    folded = positions.copy()
    folded[moved, :2] += 2.0 * beyond[moved, None] * normal
    turned = _local_top(positions[moved], layers[moved], positions[moved], spacing) - layers[moved]
    below = _local_top(positions[~moved], layers[~moved], folded[moved], spacing)
    new_layers = layers.copy()
    new_layers[moved] = below + 1 + turned
    return folded, new_layers


def _local_top(
    stack: FloatArray, layers: np.ndarray, places: FloatArray, spacing: float
) -> np.ndarray:
    """Highest layer of a stack within a vertex spacing around each place; -1 where it is empty."""
    tree = cKDTree(stack[:, :2])
    near = tree.query_ball_point(places[:, :2], 0.75 * spacing)
    return np.array([layers[found].max() if found else -1 for found in near], dtype=np.int64)
