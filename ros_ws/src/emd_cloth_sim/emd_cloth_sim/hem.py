"""The edge of the cloth's silhouette, where hands grasp (paper, IV-B)."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import binary_closing, binary_erosion, binary_fill_holes
from scipy.spatial import ConvexHull, cKDTree

from emd_cloth_sim.mesh import IndexArray
from emd_core.frames import FloatArray


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
    nearest = cKDTree(positions_in_table[:, :2]).query(edge_points)[1]
    return np.unique(nearest).astype(np.int32)


def cloth_corners(vertices: tuple[int, int]) -> list[int]:
    """Corners of the cloth in order around it."""
    n_x, n_y = vertices
    return [0, n_y - 1, n_x * n_y - 1, (n_x - 1) * n_y]


def neighbour_corners(first: int, visible: list[int], vertices: tuple[int, int]) -> list[int]:
    """Visible corners that share a side of the cloth with `first`; none if it is no corner."""
    corners = cloth_corners(vertices)
    if first not in corners:
        return []
    place = corners.index(first)
    neighbours = (corners[place - 1], corners[(place + 1) % 4])
    return [corner for corner in visible if corner in neighbours]


def outline_corners(points: FloatArray) -> FloatArray:
    """Corners (4, 2), in order, of the smallest rectangle around points (N, 2).

    It shares a direction with a side of the points' convex hull.
    """
    hull = points[ConvexHull(points).vertices]
    sides = np.roll(hull, -1, axis=0) - hull
    along = sides / np.linalg.norm(sides, axis=1, keepdims=True)
    frames = np.stack([along, along[:, ::-1] * (-1.0, 1.0)], axis=1)  # (H, 2, 2), rows: axes
    turned = hull @ frames.transpose(0, 2, 1)
    low, high = turned.min(axis=1), turned.max(axis=1)
    best = int(np.prod(high - low, axis=1).argmin())
    (x0, y0), (x1, y1) = low[best], high[best]
    return np.array([(x0, y0), (x0, y1), (x1, y1), (x1, y0)]) @ frames[best]
