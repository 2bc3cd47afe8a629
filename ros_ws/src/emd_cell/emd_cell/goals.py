"""What the cloth should look like: a neat fold by name, or a voxel grid's file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.neat_folds import NEAT_FOLDS, neat_fold
from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView
from emd_core.voxel_grid import VoxelGrid


@dataclass(frozen=True)
class Goal:
    """A goal state.

    Attributes:
        name: As it was asked for.
        grid: What the cloth should look like.
        steps: Manipulations that it takes by hand; 1 for a file.
    """

    name: str
    grid: VoxelGrid
    steps: int


def load_goal(name: str) -> Goal:
    """Find a goal by the name of a neat fold or by its file.

    Raises:
        InvalidInputError: If it is neither, or the grid has another field of view than the cell.
    """
    if name in NEAT_FOLDS:
        fold = neat_fold(name, ClothConfig())
        return Goal(name, fold.goal_grid(FieldOfView()), len(fold.manipulations))
    if not Path(name).exists():
        raise InvalidInputError(
            f"the goal must be one of {', '.join(NEAT_FOLDS)} or a voxel grid's file, got {name}"
        )
    grid = VoxelGrid.load(Path(name))
    if grid.field_of_view != FieldOfView():
        raise InvalidInputError(
            f"{name} has another field of view than the cell: {grid.field_of_view} instead of "
            f"{FieldOfView()}; voxelise the goal with the cell's"
        )
    return Goal(name, grid, 1)
