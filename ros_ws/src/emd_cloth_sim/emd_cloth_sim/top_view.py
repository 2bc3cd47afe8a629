"""A picture of a cloth seen from above, without a camera."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import zoom

PIXELS = 150
DESK = (0.93, 0.92, 0.90)
UPPER = (0.25, 0.52, 0.75)
LOWER = (0.95, 0.68, 0.30)
LIGHT = (-0.45, -0.35, 0.82)


def top_view(
    points: NDArray[np.float32], mesh: tuple[int, int] | None, view: float
) -> NDArray[np.float64]:
    """Draw the highest point in each pixel, lit from the upper left.

    Args:
        points: Normalised, shape (V, 3).
        mesh: Vertices along x and y if the points are a mesh, row by row; then its upper and lower
            side are told apart by colour.
        view: The picture covers [-view, view] in x, downwards, and y, to the right.

    Returns:
        Shape (PIXELS, PIXELS, 3), 0..1.
    """
    if mesh is None:
        surface, colours = points.astype(np.float64), np.tile(UPPER, (len(points), 1))
    else:
        surface, colours = _lit_mesh(points.reshape(*mesh, 3).astype(np.float64), view)
    image = np.tile(np.array(DESK), (PIXELS, PIXELS, 1))
    pixels = np.floor((surface[:, :2] + view) / (2 * view) * PIXELS).astype(np.int64)
    order = np.argsort(surface[:, 2], kind="stable")
    visible = np.all((pixels >= 0) & (pixels < PIXELS), axis=1)
    order = order[np.asarray(visible)[order]]
    image[pixels[order, 0], pixels[order, 1]] = colours[order]  # the highest comes last
    return image


def _lit_mesh(
    grid: NDArray[np.float64], view: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Refine a mesh (n_x, n_y, 3) to below a pixel; points (N, 3) and their colours (N, 3)."""
    sides = [np.linalg.norm(np.diff(grid, axis=axis), axis=2).max() for axis in (0, 1)]
    finer = max(1, int(np.ceil(1.5 * max(sides) * PIXELS / (2 * view))))
    counts = [(count - 1) * finer + 1 for count in grid.shape[:2]]
    factors = (counts[0] / grid.shape[0], counts[1] / grid.shape[1], 1)
    fine = zoom(grid, factors, order=1, grid_mode=False)
    normals = np.cross(np.gradient(fine, axis=0), np.gradient(fine, axis=1))
    normals /= np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-12)
    upper = normals[..., 2] > 0.0
    facing = np.where(upper[..., None], normals, -normals)
    light = np.array(LIGHT) / np.linalg.norm(LIGHT)
    brightness = 0.45 + 0.6 * np.clip(facing @ light, 0.0, 1.0)
    colours = np.where(upper[..., None], UPPER, LOWER) * brightness[..., None]
    return fine.reshape(-1, 3), np.clip(colours, 0.0, 1.0).reshape(-1, 3)
