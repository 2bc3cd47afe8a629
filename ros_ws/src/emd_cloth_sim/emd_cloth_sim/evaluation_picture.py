"""A picture of the best, the median and the worst replay of a reference sequence."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np

from emd_cloth_sim.evaluate import Pair
from emd_cloth_sim.replay import resample_sheet
from emd_core.frames import FloatArray
from emd_core.whole_file import whole_file

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402  (the backend is chosen first)

PIXELS = 256
FINER = 4
MARGIN = 0.1
HIGHEST = 0.25


def height_image(positions: FloatArray, low: FloatArray, width: float) -> FloatArray:
    """Look at a square mesh from above: highest z a pixel, (PIXELS, PIXELS), NaN without cloth.

    Args:
        positions: Vertices (V, 3).
        low: Lowest x and y of the picture.
        width: Its extent along both.
    """
    side = round(len(positions) ** 0.5)
    points = resample_sheet(positions, FINER * (side - 1) + 1)
    pixel = np.floor((points[:, :2] - low) / width * PIXELS).astype(np.int64)
    inside = ((pixel >= 0) & (pixel < PIXELS)).all(axis=1)
    image = np.full((PIXELS, PIXELS), -np.inf)
    np.maximum.at(image, tuple(pixel[inside].T), points[inside, 2])
    return np.where(np.isfinite(image), image, np.nan)


def examples(pairs: Sequence[Pair]) -> list[tuple[str, Pair]]:
    """Choose the best, the median and the worst pair by relative voxel MSE."""
    order = sorted(pairs, key=lambda pair: pair.relative_mse)
    return [("best", order[0]), ("median", order[len(order) // 2]), ("worst", order[-1])]


def draw_examples(pairs: Sequence[Pair], path: Path) -> None:
    """Draw the examples: before, the reference after, ours after, coloured by height."""
    rows = examples(pairs)
    figure, axes = plt.subplots(len(rows), 3, figsize=(8.4, 9.0))
    for (name, pair), row in zip(rows, axes, strict=True):
        _draw_pair(name, pair, row)
    figure.tight_layout(pad=0.6)
    try:
        with whole_file(path) as temporary:
            figure.savefig(temporary, dpi=100)
    finally:
        plt.close(figure)


def _draw_pair(name: str, pair: Pair, row: Sequence[plt.Axes]) -> None:
    states = (pair.case.before, pair.case.after, pair.outcome)
    corners = np.concatenate(states)[:, :2]
    low, high = corners.min(axis=0) - MARGIN, corners.max(axis=0) + MARGIN
    width = float((high - low).max())
    low = 0.5 * (low + high - width)
    step = f"{Path(pair.case.file).stem}, step {pair.case.step + 1}"
    titles = (
        f"{name}: {step}",
        f"reference (do nothing {pair.do_nothing.voxel_mse:.3f})",
        f"ours: MSE {pair.figures.voxel_mse:.3f}, IoU {pair.figures.silhouette_iou:.2f}",
    )
    for axis, state, title in zip(row, states, titles, strict=True):
        # x runs down the picture, as the head camera sees the table.
        axis.imshow(height_image(state, low, width), cmap="viridis", vmin=0.0, vmax=HIGHEST)
        axis.set_title(title, fontsize=8)
        axis.set_xticks([])
        axis.set_yticks([])
