"""Random manipulations for training: the authors' rule, grasps at the hem, and folds."""

from __future__ import annotations

import math

import numpy as np
from scipy.ndimage import binary_closing, binary_erosion, binary_fill_holes

from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.mesh import IndexArray
from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView, FloatArray
from emd_core.manipulation import Manipulation

MODES = ("mixed", "any", "hem", "fold")
LONGEST = 1.4
SHORTEST_AT_HEM = 0.1
SECOND_HAND = 0.5
CORNER = 0.5
HEM_SHARE = 0.7
FOLD_LENGTHS = (0.2, 1.1)
FOLD_ANGLE = 0.25
FOLD_STRAY = 0.3


def random_manipulation(
    cloth: Cloth, mode: str, field_of_view: FieldOfView, rng: np.random.Generator
) -> Manipulation:
    """Draw a manipulation for the cloth's present state.

    Args:
        cloth: The cloth.
        mode: `any` (the authors' rule), `hem` (grasps on the silhouette's edge, paper IV-B),
            `mixed` (70 % hem, 30 % any) or `fold` (corners carried across the cloth).
        field_of_view: Scale of the normalised lengths.
        rng: Source of randomness.

    Raises:
        InvalidInputError: If the mode is unknown.
    """
    if mode not in MODES:
        raise InvalidInputError(f"mode must be one of {', '.join(MODES)}, got {mode!r}")
    if mode == "mixed":
        mode = "hem" if rng.random() < HEM_SHARE else "any"
    if mode == "fold":
        return manipulation_to_fold(cloth, field_of_view, rng)
    if mode == "hem":
        return manipulation_at_hem(cloth, field_of_view, rng)
    return manipulation_anywhere(cloth, field_of_view, rng)


def manipulation_anywhere(
    cloth: Cloth, field_of_view: FieldOfView, rng: np.random.Generator
) -> Manipulation:
    """Draw by the rule of the authors' public generator.

    Two random vertices, one dropped with probability 0.5; a displacement of uniform angle and of
    length uniform in 0..1.4 normalised.
    """
    positions = cloth.positions_in_table
    points = positions[rng.integers(len(positions), size=2), :2].copy()
    if rng.random() >= SECOND_HAND:
        points[1] = np.nan
    return Manipulation(
        points, _polar(rng.uniform(0.0, LONGEST), rng.uniform(0.0, 2 * math.pi), field_of_view)
    )


def manipulation_at_hem(
    cloth: Cloth, field_of_view: FieldOfView, rng: np.random.Generator
) -> Manipulation:
    """Draw grasp points on the silhouette's edge and a displacement towards the cloth's inside.

    Half of the first points are corners of the cloth, if one lies on the edge. With probability
    0.5 a second hand takes another point of the edge, by half a neighbouring corner of the cloth.
    The length is uniform in 0.1..1.4 normalised, the angle within 90 degrees of the direction to
    the silhouette's centroid.
    """
    positions = cloth.positions_in_table
    hem = hem_vertices(positions, cloth.mesh.triangles, max(cloth.config.spacing))
    corners = [v for v in _corners(cloth.config.vertices) if v in set(hem.tolist())]
    first = _pick(hem, corners, rng)
    points = np.full((2, 2), np.nan)
    points[0] = positions[first, :2]
    if rng.random() < SECOND_HAND:
        near = _neighbour_corners(first, corners, cloth.config.vertices)
        points[1] = positions[_pick(hem[hem != first], near, rng), :2]
    inwards = positions[:, :2].mean(axis=0) - np.nanmean(points, axis=0)
    angle = math.atan2(inwards[1], inwards[0]) + rng.uniform(-0.5, 0.5) * math.pi
    return Manipulation(
        points, _polar(rng.uniform(SHORTEST_AT_HEM, LONGEST), angle, field_of_view)
    )


def manipulation_to_fold(
    cloth: Cloth, field_of_view: FieldOfView, rng: np.random.Generator
) -> Manipulation:
    """Draw what people do: carry a corner, or the two at one side, towards the opposite end.

    The corners must lie on the silhouette's edge; each hand strays from its corner by up to 0.3
    normalised along the edge. Way and angle are those to the opposite corner or side, times 0.2
    to 1.1 and turned by a normal deviation of 0.25 rad. Without a visible corner the grasp is
    drawn by `manipulation_at_hem`.
    """
    positions = cloth.positions_in_table[:, :2]
    hem = hem_vertices(cloth.positions_in_table, cloth.mesh.triangles, max(cloth.config.spacing))
    corners = _corners(cloth.config.vertices)
    visible = [corner for corner in corners if corner in set(hem.tolist())]
    if not visible:
        return manipulation_at_hem(cloth, field_of_view, rng)
    grasped = [visible[rng.integers(len(visible))]]
    near = _neighbour_corners(grasped[0], visible, cloth.config.vertices)
    if near and rng.random() < SECOND_HAND:
        grasped.append(near[rng.integers(len(near))])
    opposite = [corners[(corners.index(corner) + 2) % 4] for corner in grasped]
    way = positions[opposite].mean(axis=0) - positions[grasped].mean(axis=0)
    stray = float(field_of_view.table_from_normalised(FOLD_STRAY))
    points = np.full((2, 2), np.nan)
    for hand, corner in enumerate(grasped):
        gaps = np.linalg.norm(positions[hem] - positions[corner], axis=1)
        points[hand] = positions[rng.choice(hem[gaps <= rng.uniform(0.0, stray) + 1e-9])]
    angle = math.atan2(way[1], way[0]) + rng.normal(0.0, FOLD_ANGLE)
    length = np.linalg.norm(way) * rng.uniform(*FOLD_LENGTHS)
    return Manipulation(points, length * np.array([math.cos(angle), math.sin(angle)]))


def hem_vertices(
    positions_in_table: FloatArray, triangles: IndexArray, spacing: float
) -> IndexArray:
    """Find the vertices at the edge of the silhouette seen from above; indices, sorted.

    The silhouette is rasterised at half the vertex spacing (metres) from vertices, sides and
    centres of the triangles; of every pixel at its edge the closest vertex belongs to the hem.
    """
    corners = positions_in_table[triangles, :2]
    middles = 0.5 * (corners + np.roll(corners, 1, axis=1))
    centres = corners.mean(axis=1, keepdims=True)
    points = np.concatenate([corners, middles, centres], axis=1).reshape(-1, 2)
    pixel = 0.5 * spacing
    low = points.min(axis=0) - 3 * pixel
    pixels = np.floor((points - low) / pixel).astype(np.int64)
    image = np.zeros(pixels.max(axis=0) + 4, dtype=bool)
    image[pixels[:, 0], pixels[:, 1]] = True
    image = binary_fill_holes(binary_closing(image))
    edge = image & ~binary_erosion(image)
    edge_points = (np.argwhere(edge) + 0.5) * pixel + low
    gaps = np.linalg.norm(edge_points[:, None] - positions_in_table[None, :, :2], axis=2)
    return np.unique(gaps.argmin(axis=1)).astype(np.int32)


def _pick(vertices: IndexArray, preferred: list[int], rng: np.random.Generator) -> int:
    """Draw one of `preferred` half of the time, if there are any, otherwise one of `vertices`."""
    if preferred and rng.random() < CORNER:
        return preferred[rng.integers(len(preferred))]
    return int(rng.choice(vertices))


def _corners(vertices: tuple[int, int]) -> list[int]:
    """Corners of the cloth in order around it."""
    n_x, n_y = vertices
    return [0, n_y - 1, n_x * n_y - 1, (n_x - 1) * n_y]


def _neighbour_corners(first: int, visible: list[int], vertices: tuple[int, int]) -> list[int]:
    """Visible corners that share a side of the cloth with `first`; none if it is no corner."""
    corners = _corners(vertices)
    if first not in corners:
        return []
    place = corners.index(first)
    neighbours = (corners[place - 1], corners[(place + 1) % 4])
    return [corner for corner in visible if corner in neighbours]


def _polar(length: float, angle: float, field_of_view: FieldOfView) -> FloatArray:
    """Turn a normalised length and an angle (radians) into a displacement in metres."""
    return field_of_view.table_from_normalised(
        length * np.array([math.cos(angle), math.sin(angle)])
    )
