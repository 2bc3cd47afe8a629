"""Goals to choose from: neat folds, the present state, a file, what a manipulation would give."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.neat_folds import NEAT_FOLDS, neat_fold
from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView
from emd_core.voxel_grid import VoxelGrid

PRESENT = "present"
FILE = "file"
WHAT_IF = "what_if"
TITLES = {
    "half": "Half, towards the robot",
    "half_left": "Half, to the right",
    "diagonal": "Diagonal",
    "corner": "One corner",
    "quarter": "Quarter",
    "double_corner": "Two corners",
    "thirds": "Thirds",
}


@dataclass(frozen=True)
class Goal:
    """What the cloth should look like.

    Attributes:
        name: Of a neat fold, `present`, `file` or `what_if`.
        title: For people.
        grid: The state.
        steps: Manipulations that it takes by hand; 1 where that is unknown.
    """

    name: str
    title: str
    grid: VoxelGrid
    steps: int = 1


@cache
def neat_goal(name: str) -> Goal:
    """Make the goal of a neat fold.

    Raises:
        InvalidInputError: If there is no fold of that name.
    """
    if name not in NEAT_FOLDS:
        raise InvalidInputError(f"a goal must be one of {', '.join(NEAT_FOLDS)}, got {name!r}")
    fold = neat_fold(name, ClothConfig())
    title = TITLES.get(name, name.replace("_", " ").capitalize())
    return Goal(name, title, fold.goal_grid(FieldOfView()), len(fold.manipulations))


def gallery() -> tuple[Goal, ...]:
    """All neat folds, in their order."""
    return tuple(neat_goal(name) for name in NEAT_FOLDS)
