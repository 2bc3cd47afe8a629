"""Neat folds carried out not quite neatly, for training."""

from __future__ import annotations

import numpy as np

from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.hem import hem_vertices
from emd_cloth_sim.neat_folds import NEAT_FOLDS, neat_fold
from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView
from emd_core.manipulation import Manipulation

STRAY = 0.04  # standard deviation of points and displacements along x and y, normalised


def draw_neat_fold(config: ClothConfig, rng: np.random.Generator) -> list[Manipulation]:
    """Draw one of the neat folds, turned by quarters and mirrored as it comes.

    Args:
        config: Of the flat, centred cloth that is folded.
        rng: Source of randomness.

    Raises:
        InvalidInputError: If the cloth is not square, as turned folds would not fit it.
    """
    if config.side_lengths[0] != config.side_lengths[1]:
        raise InvalidInputError(
            f"neat sequences need a square cloth, got {config.side_lengths} m; use mode 'fold'"
        )
    fold = neat_fold(NEAT_FOLDS[rng.integers(len(NEAT_FOLDS))], config)
    turn = np.linalg.matrix_power(np.array([[0.0, -1.0], [1.0, 0.0]]), int(rng.integers(4)))
    if rng.random() < 0.5:
        turn = turn @ np.diag([1.0, -1.0])
    return [
        Manipulation(m.grasp_points_in_table @ turn.T, m.displacement_in_table @ turn.T)
        for m in fold.manipulations
    ]


def astray(
    wanted: Manipulation, cloth: Cloth, field_of_view: FieldOfView, rng: np.random.Generator
) -> Manipulation:
    """Let hands stray from a manipulation, but grasp at the edge of the cloth as it lies.

    Args:
        wanted: What would be neat.
        cloth: In its present state.
        field_of_view: Scale of `STRAY`.
        rng: Source of randomness.
    """
    stray = float(field_of_view.table_from_normalised(STRAY))
    positions = cloth.positions_in_table
    hem = hem_vertices(positions, cloth.triangles, max(cloth.config.spacing))
    edge = positions[hem, :2]
    points = wanted.grasp_points_in_table.copy()
    for hand in np.flatnonzero(wanted.used):
        meant = points[hand] + rng.normal(0.0, stray, 2)
        points[hand] = edge[np.linalg.norm(edge - meant, axis=1).argmin()]
    return Manipulation(points, wanted.displacement_in_table + rng.normal(0.0, stray, 2))
