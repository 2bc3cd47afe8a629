"""Where a hand can grasp: the hems near a grasp point (paper, IV-B item 1 and V-B)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from emd_arm_executor.config import HemConfig
from emd_arm_executor.hem_contour import HemContour, extract_hems
from emd_arm_executor.silhouette import Silhouette
from emd_core.errors import InvalidInputError, NoHemError
from emd_core.frames import FloatArray


@dataclass(frozen=True)
class Hem:
    """A place on the hem and the direction in which it faces.

    Attributes:
        point_in_table: On the hem, shape (2,), metres.
        outward_normal: Unit vector out of the cloth, orthogonal to the hem; at a corner the
            bisector, shape (2,).
        distance: From the grasp point that was asked for, metres.
        inside: Whether that grasp point lies inside the cloth.
        edge: (outline, edge) on which the point lies.
        corner: Whether the normal is a corner's bisector.
        asked_direction: Unit vector along which the hand shall come, shape (2,); None: along the
            normal or, where that is impossible, near it.
    """

    point_in_table: FloatArray
    outward_normal: FloatArray
    distance: float
    inside: bool
    edge: tuple[int, int]
    corner: bool = False
    asked_direction: FloatArray | None = None


def find_hems(
    silhouette: Silhouette | Sequence[HemContour],
    grasp_point_in_table: ArrayLike,
    count: int = 3,
    config: HemConfig | None = None,
) -> list[Hem]:
    """Find the hem nearest to a grasp point and the next ones on other edges.

    Near a corner the first candidate faces along the corner's bisector; the two hems that meet
    there follow, each with its own normal.

    Args:
        silhouette: The cloth, or its outlines from `extract_hems`.
        grasp_point_in_table: Shape (2,), metres.
        count: Most candidates to return, at least 1.
        config: Distances.

    Returns:
        One to `count` hems, the nearest first.

    Raises:
        InvalidInputError: If the point or the count is unusable.
        NoHemError: If the cloth has no hem, or none near enough.
    """
    config = config or HemConfig()
    point = np.asarray(grasp_point_in_table, dtype=np.float64)
    if point.shape != (2,) or not np.isfinite(point).all() or count < 1:
        raise InvalidInputError(
            f"a finite grasp point (2,) and a count of at least 1 are wanted, got {point}, {count}"
        )
    contours = (
        extract_hems(silhouette, config) if isinstance(silhouette, Silhouette) else silhouette
    )
    inside = any(contour.contains(point) for contour in contours)
    hems = [
        _nearest_on_edge(contour, (outline, edge), point, inside, config)
        for outline, contour in enumerate(contours)
        for edge in range(len(contour.vertices_in_table))
    ]
    hems.sort(key=lambda hem: hem.distance)
    limit = config.max_distance_inside if inside else config.max_distance_outside
    near = [hem for hem in hems if hem.distance <= limit]
    if not near:
        raise NoHemError(_explain(point, hems, inside, limit))
    corner = _corner_at(contours, near[0], config)
    return ([corner] if corner else [])[:count] + near[: count - (1 if corner else 0)]


def facing(hems: Sequence[Hem], direction: FloatArray, max_turn: float) -> list[Hem]:
    """Keep the hems at which a hand can come along a direction that was asked for.

    Args:
        hems: The nearest first.
        direction: Unit vector into the cloth, shape (2,).
        max_turn: Largest angle between it and a hem's inward normal, radians.

    Returns:
        Those hems, told the direction, in their order.

    Raises:
        NoHemError: If there is none.
    """
    turns = [float(np.arccos(np.clip(-hem.outward_normal @ direction, -1, 1))) for hem in hems]
    kept = [
        replace(hem, asked_direction=direction)
        for hem, turn in zip(hems, turns, strict=True)
        if turn <= max_turn
    ]
    if not kept:
        least = np.rad2deg(min(turns))
        raise NoHemError(
            f"a hem that is grasped along ({direction[0]:.2f}, {direction[1]:.2f}) is wanted, "
            f"within {np.rad2deg(max_turn):.0f} degrees; the {len(hems)} near the grasp point "
            f"are off by {least:.0f} degrees or more: turn the direction, or leave it open"
        )
    return kept


def _explain(point: FloatArray, hems: Sequence[Hem], inside: bool, limit: float) -> str:
    place = "inside" if inside else "outside"
    nearest = f"{hems[0].distance:.3f} m away" if hems else "nowhere"
    return (
        f"a hem within {limit:.3f} m of the grasp point ({point[0]:.3f}, {point[1]:.3f}) m "
        f"{place} the cloth is wanted, the nearest is {nearest}; grasp nearer to the hem"
    )


def _nearest_on_edge(
    contour: HemContour,
    edge: tuple[int, int],
    point: FloatArray,
    inside: bool,
    config: HemConfig,
) -> Hem:
    """Give the nearest point of one edge, kept off its ends so that a nail finds cloth."""
    index = edge[1]
    start, length = contour.vertices_in_table[index], float(contour.lengths[index])
    along = contour.directions[index]
    inset = min(config.corner_inset, length / 2.0)
    progress = float(np.clip(along @ (point - start), inset, length - inset))
    nearest = start + progress * along
    distance = float(np.linalg.norm(point - nearest))
    return Hem(nearest, contour.outward_normals[index], distance, inside, edge)


def _corner_at(contours: Sequence[HemContour], hem: Hem, config: HemConfig) -> Hem | None:
    """Give the corner that a hem point lies next to, facing along its bisector, if any."""
    outline, index = hem.edge
    contour = contours[outline]
    vertices, normals = contour.vertices_in_table, contour.outward_normals
    for vertex in (index, (index + 1) % len(vertices)):
        before, after = normals[vertex - 1], normals[vertex]
        offset = float(np.linalg.norm(vertices[vertex] - hem.point_in_table))
        convex = before[0] * after[1] - before[1] * after[0] > np.sin(config.corner_angle)
        if convex and offset <= config.corner_radius:
            bisector = before + after
            bisector /= np.linalg.norm(bisector)
            return Hem(vertices[vertex], bisector, hem.distance, hem.inside, hem.edge, True)
    return None
