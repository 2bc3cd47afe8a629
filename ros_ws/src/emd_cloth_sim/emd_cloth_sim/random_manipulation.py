"""Random manipulations for training: the authors' rules, grasps at the hem, and folds."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.hem import (
    cloth_corners,
    hem_vertices,
    neighbour_corners,
    outline_corners,
)
from emd_cloth_sim.mesh import IndexArray
from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView, FloatArray
from emd_core.independent_manipulation import HandsManipulation, IndependentManipulation
from emd_core.manipulation import Manipulation

MODES = ("any", "paper", "hem", "mixed", "fold", "neat")
LONGEST = 1.4
SHORTEST_AT_HEM = 0.1
SECOND_HAND = 0.5
CORNER = 0.5
HEM_SHARE = 0.7
OUTLINE = 0.5
FOLD_LENGTHS = (0.2, 1.1)
FOLD_ANGLE = 0.25
FOLD_STRAY = 0.3
NEAT_SHARE = 0.5
NEAT_SPREAD = 0.2


@dataclass(frozen=True)
class ManipulationRule:
    """How manipulations are drawn.

    Attributes:
        mode: `any`: the rule of the authors' public generator, two random vertices and a
            displacement of uniform angle and of length uniform in 0..1.4 normalised. `paper`: as
            the paper has it (IV-A), the displacement's x and y uniform in -1..1 normalised. `hem`:
            grasps at the silhouette's edge, displacement towards the cloth's inside. `mixed`: 70 %
            hem, 30 % any. `fold`: corners of the cloth or of its outline carried across it, half
            of the time nearly straight. One of two hands is dropped with probability 0.5. `neat`:
            a sequence begins with a neat fold (`neat_sequences`) and goes on as `fold`.
        edge_only: Whether `any` and `paper` too grasp only at the silhouette's edge, as the
            paper's robot does (IV-B); the other modes always do.
        independent_hands: Whether each hand draws a displacement of its own by the same rule.
    """

    mode: str = "any"
    edge_only: bool = False
    independent_hands: bool = False

    def __post_init__(self) -> None:
        """Check the mode.

        Raises:
            InvalidInputError: If it is unknown, or neat with independent hands.
        """
        if self.mode not in MODES:
            raise InvalidInputError(f"mode must be one of {', '.join(MODES)}, got {self.mode!r}")
        if self.mode == "neat" and self.independent_hands:
            raise InvalidInputError("neat folds move both hands alike, got independent_hands")

    def draw(
        self, cloth: Cloth, field_of_view: FieldOfView, rng: np.random.Generator
    ) -> HandsManipulation:
        """Draw a manipulation for the cloth's present state.

        Args:
            cloth: The cloth.
            field_of_view: Scale of the normalised lengths.
            rng: Source of randomness.
        """
        mode, spread = self.mode, 1.0
        if mode == "mixed":
            mode = "hem" if rng.random() < HEM_SHARE else "any"
        if mode in ("fold", "neat"):
            spread = NEAT_SPREAD if rng.random() < NEAT_SHARE else 1.0
            mode, points, ways = _grasps_to_fold(cloth, field_of_view, spread, rng)
        elif mode == "hem":
            points, ways = _grasps_at_hem(cloth, rng)
        else:
            points, ways = _grasps_anywhere(cloth, self.edge_only, rng), np.zeros((2, 2))
        if not self.independent_hands:
            way = np.nanmean(ways, axis=0)
            return Manipulation(points, _displacement(mode, way, field_of_view, spread, rng))
        displacements = np.full((2, 2), np.nan)
        for hand in np.flatnonzero(np.isfinite(points).all(axis=1)):
            displacements[hand] = _displacement(mode, ways[hand], field_of_view, spread, rng)
        return IndependentManipulation(points, displacements)


def _grasps_anywhere(cloth: Cloth, edge_only: bool, rng: np.random.Generator) -> FloatArray:
    """Draw two vertices, one dropped with probability 0.5; (2, 2), metres."""
    positions = cloth.positions_in_table
    candidates = _hem(cloth) if edge_only else np.arange(len(positions))
    points = positions[candidates[rng.integers(len(candidates), size=2)], :2]
    if rng.random() >= SECOND_HAND:
        points[1] = np.nan
    return points


def _grasps_at_hem(cloth: Cloth, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Draw points on the silhouette's edge, and the ways from them to its centroid.

    Half of the first points are corners of the cloth, if one lies on the edge. With probability
    0.5 a second hand takes another point of the edge, by half a neighbouring corner of the cloth.
    """
    positions = cloth.positions_in_table
    hem = _hem(cloth)
    corners = _visible_corners(cloth, hem)
    first = _pick(hem, corners, rng)
    points = np.full((2, 2), np.nan)
    points[0] = positions[first, :2]
    if rng.random() < SECOND_HAND:
        near = neighbour_corners(first, corners, cloth.config.vertices)
        points[1] = positions[_pick(hem[hem != first], near, rng), :2]
    return points, positions[:, :2].mean(axis=0) - points


def _grasps_to_fold(
    cloth: Cloth, field_of_view: FieldOfView, spread: float, rng: np.random.Generator
) -> tuple[str, FloatArray, FloatArray]:
    """Draw a corner or the two at one side, and the ways to the opposite corner or side.

    Corners are those of the cloth or, as often, of the smallest rectangle around it, which are
    ends of creases when it is folded. One must lie at the silhouette's edge; each hand strays from
    its corner by up to 0.3 normalised, times `spread`, along the edge. Where no corner does, the
    grasp is drawn as at the hem.

    Returns:
        The mode of the displacement, points and ways.
    """
    positions = cloth.positions_in_table[:, :2]
    edge = positions[_hem(cloth)]
    corners, tolerance = positions[cloth_corners(cloth.config.vertices)], 1e-9
    if rng.random() < OUTLINE:
        corners, tolerance = outline_corners(edge), 2.0 * max(cloth.config.spacing)
    gaps = np.linalg.norm(edge - corners[:, None], axis=2)
    free = np.flatnonzero(gaps.min(axis=1) <= tolerance)
    if not len(free):
        return "hem", *_grasps_at_hem(cloth, rng)
    grasped = [rng.choice(free)]
    near = [corner for corner in free if (corner - grasped[0]) % 2 == 1]
    if near and rng.random() < SECOND_HAND:
        grasped.append(rng.choice(near))
    stray = spread * float(field_of_view.table_from_normalised(FOLD_STRAY))
    points, ways = np.full((2, 2), np.nan), np.full((2, 2), np.nan)
    for hand, corner in enumerate(grasped):
        reach = max(rng.uniform(0.0, stray), gaps[corner].min() + 1e-9)
        points[hand] = rng.choice(edge[gaps[corner] <= reach])
        ways[hand] = corners[(corner + 2) % 4] - corners[corner]
    return "fold", points, ways


def _displacement(
    mode: str,
    way: FloatArray,
    field_of_view: FieldOfView,
    spread: float,
    rng: np.random.Generator,
) -> FloatArray:
    """Draw a displacement (2,), metres.

    Hem: length uniform in 0.1..1.4 normalised, angle within 90 degrees of the way. Fold: the
    way's length times 0.2 to 1.1, its angle turned by a normal deviation of 0.25 rad times
    `spread`.
    """
    if mode == "paper":
        return field_of_view.table_from_normalised(rng.uniform(-1.0, 1.0, size=2))
    if mode == "any":
        length, angle = rng.uniform(0.0, LONGEST), rng.uniform(0.0, 2 * math.pi)
        return field_of_view.table_from_normalised(_polar(length, angle))
    angle = math.atan2(way[1], way[0])
    if mode == "fold":
        angle += rng.normal(0.0, spread * FOLD_ANGLE)
        return _polar(float(np.linalg.norm(way)) * rng.uniform(*FOLD_LENGTHS), angle)
    angle += rng.uniform(-0.5, 0.5) * math.pi
    length = rng.uniform(SHORTEST_AT_HEM, LONGEST)
    return field_of_view.table_from_normalised(_polar(length, angle))


def _hem(cloth: Cloth) -> IndexArray:
    return hem_vertices(cloth.positions_in_table, cloth.triangles, max(cloth.config.spacing))


def _visible_corners(cloth: Cloth, hem: IndexArray) -> list[int]:
    on_edge = set(hem.tolist())
    return [corner for corner in cloth_corners(cloth.config.vertices) if corner in on_edge]


def _pick(vertices: IndexArray, preferred: list[int], rng: np.random.Generator) -> int:
    """Draw one of `preferred` half of the time, if there are any, otherwise one of `vertices`."""
    if preferred and rng.random() < CORNER:
        return preferred[rng.integers(len(preferred))]
    return int(rng.choice(vertices))


def _polar(length: float, angle: float) -> FloatArray:
    return length * np.array([math.cos(angle), math.sin(angle)])
