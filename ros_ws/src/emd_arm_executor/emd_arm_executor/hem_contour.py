"""A silhouette's outline as polygons with straight hems and sharp corners, below pixel size."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from emd_arm_executor.config import HemConfig
from emd_arm_executor.silhouette import Silhouette
from emd_core.errors import NoHemError
from emd_core.frames import FloatArray


@dataclass(frozen=True)
class HemContour:
    """One outer outline of the cloth; edge i runs from vertex i to vertex i + 1.

    Attributes:
        vertices_in_table: Corners, counter-clockwise in the axes of the table frame, shape
            (N, 2), metres, N >= 3.
    """

    vertices_in_table: FloatArray

    @property
    def directions(self) -> FloatArray:
        """Unit vectors along the edges, shape (N, 2)."""
        along = np.roll(self.vertices_in_table, -1, axis=0) - self.vertices_in_table
        return np.asarray(along / np.linalg.norm(along, axis=1, keepdims=True))

    @property
    def outward_normals(self) -> FloatArray:
        """Unit vectors out of the cloth, one for each edge, shape (N, 2)."""
        return _normals(self.directions)

    @property
    def lengths(self) -> FloatArray:
        """Lengths of the edges, shape (N,), metres."""
        along = np.roll(self.vertices_in_table, -1, axis=0) - self.vertices_in_table
        return np.asarray(np.linalg.norm(along, axis=1))

    def contains(self, point_in_table: FloatArray) -> bool:
        """Tell whether a point (2,) lies inside the outline."""
        outline = self.vertices_in_table.astype(np.float32).reshape(-1, 1, 2)
        x, y = (float(value) for value in point_in_table)
        return cv2.pointPolygonTest(outline, (x, y), False) >= 0


def extract_hems(silhouette: Silhouette, config: HemConfig | None = None) -> list[HemContour]:
    """Trace the outer outlines of a silhouette; holes and specks are left out.

    The mask's border is cut at its corners (Douglas-Peucker), a line is fitted to the pixels of
    each piece (total least squares) and moved by the mask's known bias, and neighbouring lines
    meet again in sharp corners. So hems come out well below the size of a cell, and no smoothing
    rounds the corners off.

    Args:
        silhouette: The cloth.
        config: Tolerances.

    Returns:
        The outlines, largest first.

    Raises:
        NoHemError: If no piece of cloth is large enough.
    """
    config = config or HemConfig()
    borders = _borders(silhouette, config)
    contours = [_polygon(border, silhouette, config) for border in borders]
    found = [contour for contour in contours if contour is not None]
    if not found:
        raise NoHemError(
            f"a cloth of at least {config.minimum_area * 1e4:.0f} cm2 is wanted, the silhouette "
            f"covers {silhouette.mask.sum() * silhouette.resolution.prod() * 1e4:.0f} cm2; "
            "check that the cloth is in view"
        )
    return found


@dataclass(frozen=True)
class _Border:
    """Centres of the outermost cells of one piece of cloth, and how fine those cells are."""

    points: FloatArray
    refinement: int


def _borders(silhouette: Silhouette, config: HemConfig) -> list[_Border]:
    refinement = max(1, int(np.ceil(silhouette.resolution.max() / config.tracing_resolution)))
    padded = np.pad(silhouette.mask, 1).astype(np.uint8)
    fine = padded.repeat(refinement, axis=0).repeat(refinement, axis=1)
    outlines, _ = cv2.findContours(fine, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cell = silhouette.resolution / refinement
    large = [o for o in outlines if cv2.contourArea(o) * cell.prod() >= config.minimum_area]
    large.sort(key=cv2.contourArea, reverse=True)
    corner = silhouette.origin_in_table - silhouette.resolution
    # OpenCV's points are (column, row) = (y, x) of a mask with axes (X, Y).
    return [_Border(corner + (o[:, 0, ::-1] + 0.5) * cell, refinement) for o in large]


def _polygon(border: _Border, silhouette: Silhouette, config: HemConfig) -> HemContour | None:
    points = border.points if _area(border.points) > 0 else border.points[::-1]
    tolerance = max(config.corner_tolerance, float(silhouette.resolution.max()))
    corners = _simplify(points, _corner_indices(points, 0.9 * tolerance), tolerance)
    if len(corners) < 3:
        return None
    lines = _fit_lines(points, corners)
    # The border runs through the centres of the outermost cells, half a traced cell inside.
    inward = silhouette.outward_bias - 0.5 / border.refinement
    bias = inward * (np.abs(lines.normals) * silhouette.resolution).sum(axis=1, keepdims=True)
    moved = _Lines(lines.points - bias * lines.normals, lines.directions, lines.normals)
    return HemContour(_intersect(moved, points[corners], tolerance))


def _corner_indices(points: FloatArray, tolerance: float) -> NDArray[np.intp]:
    outline = points.astype(np.float32).reshape(-1, 1, 2)
    kept = cv2.approxPolyDP(outline, tolerance, True)[:, 0]
    distance = np.abs(points[None] - kept[:, None]).sum(axis=2)
    return np.unique(distance.argmin(axis=1))


def _simplify(points: FloatArray, corners: NDArray[np.intp], tolerance: float) -> NDArray[np.intp]:
    """Take corners out while the polygon of fitted lines stays within `tolerance` of the border.

    The raster puts two blunt corners where the cloth has a sharp one, and stray corners on long
    hems. Either one corner goes, or two neighbours make way for one between them.
    """
    sparse = points[:: max(1, len(points) // 200)]
    # Fitted lines may leave a single stray cell behind; what is bad already need not get better.
    allowed = max(1.1 * tolerance, _misfit(points, corners, sparse, tolerance))
    while len(corners) > 3:
        for option in _simpler(points, corners):
            if _misfit(points, option, sparse, tolerance) <= allowed:
                corners = option
                break
        else:
            break
    return corners


def _simpler(points: FloatArray, corners: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """List the polygons with one corner less, those that change the outline least first."""
    here = points[corners]
    ahead, behind = np.roll(here, -1, axis=0), np.roll(here, 1, axis=0)
    chord = ahead - behind
    cross = np.abs(chord[:, 0] * (here - behind)[:, 1] - chord[:, 1] * (here - behind)[:, 0])
    height = cross / np.maximum(np.linalg.norm(chord, axis=1), 1e-9)
    length = np.linalg.norm(ahead - here, axis=1) / 2.0
    options = [(change, np.delete(corners, i)) for i, change in enumerate(height)]
    options += [(c, _joined(corners, i, len(points))) for i, c in enumerate(length)]
    options.sort(key=lambda option: option[0])
    return [option for _, option in options[:6]]


def _joined(corners: NDArray[np.intp], first: int, count: int) -> NDArray[np.intp]:
    """Put one corner half-way between corner `first` and the next one instead of both."""
    second = (first + 1) % len(corners)
    middle = (corners[first] + (corners[second] - corners[first]) % count // 2) % count
    return np.sort(np.append(np.delete(corners, [first, second]), middle))


def _misfit(
    points: FloatArray, corners: NDArray[np.intp], sparse: FloatArray, tolerance: float
) -> float:
    """Greatest distance of the border's points from the polygon of fitted lines, metres."""
    start = _intersect(_fit_lines(points, corners), points[corners], tolerance)
    along = np.roll(start, -1, axis=0) - start
    offset = sparse[:, None] - start[None]
    squared = np.maximum((along**2).sum(axis=1), 1e-12)
    progress = np.clip((offset * along).sum(axis=2) / squared, 0.0, 1.0)
    distance = np.linalg.norm(offset - progress[..., None] * along, axis=2)
    return float(distance.min(axis=1).max())


@dataclass(frozen=True)
class _Lines:
    """Fitted lines: a point on each, its direction and its outward normal, shape (N, 2)."""

    points: FloatArray
    directions: FloatArray
    normals: FloatArray


def _fit_lines(points: FloatArray, corners: NDArray[np.intp]) -> _Lines:
    """Fit a line to the border between consecutive corners."""
    centres, directions = [], []
    for first, last in zip(corners, np.roll(corners, -1), strict=True):
        end = last if last > first else last + len(points)
        piece = points[np.arange(first, end) % len(points)]
        # The corners themselves are blunted by the raster: leave a sixth at either end out.
        trimmed = piece[len(piece) // 6 : len(piece) - len(piece) // 6]
        used = trimmed if len(trimmed) >= 2 else np.array([points[first], points[last]])
        centre = used.mean(axis=0)
        _, axes = np.linalg.eigh((used - centre).T @ (used - centre))
        chord = points[last] - points[first]
        directions.append(axes[:, 1] if axes[:, 1] @ chord >= 0 else -axes[:, 1])
        centres.append(centre)
    along = np.array(directions)
    return _Lines(np.array(centres), along, _normals(along))


def _intersect(lines: _Lines, corners: FloatArray, tolerance: float) -> FloatArray:
    """Join line i - 1 and line i in vertex i, near corner i."""
    vertices = np.empty_like(corners)
    for i, corner in enumerate(corners):
        pair = [i - 1, i]
        points, along, normals = lines.points[pair], lines.directions[pair], lines.normals[pair]
        feet = points + along * ((corner - points) * along).sum(axis=1, keepdims=True)
        vertices[i] = feet.mean(axis=0)
        if abs(normals[0, 0] * normals[1, 1] - normals[0, 1] * normals[1, 0]) > 0.1:
            meeting = np.linalg.solve(normals, (normals * points).sum(axis=1))
            # A spike far beyond the border would be the fit's invention, not a corner.
            if np.linalg.norm(meeting - corner) < 3.0 * tolerance:
                vertices[i] = meeting
    return vertices


def _normals(directions: FloatArray) -> FloatArray:
    return np.stack([directions[:, 1], -directions[:, 0]], axis=1)


def _area(points: FloatArray) -> float:
    """Signed area of a closed polygon, positive when it runs counter-clockwise."""
    x, y = points.T
    return float(0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1)))
