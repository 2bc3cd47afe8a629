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
SAMPLES = 321  # a side: more than pixels, so that no mesh is too coarse for a closed surface
MARGIN = 0.1
HIGHEST = 0.25


def height_image(positions: FloatArray, low: FloatArray, width: float) -> FloatArray:
    """Look at a square mesh from above: highest z a pixel, (PIXELS, PIXELS), NaN without cloth.

    Args:
        positions: Vertices (V, 3).
        low: Lowest x and y of the picture.
        width: Its extent along both.
    """
    points = resample_sheet(positions, SAMPLES)
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
    rows = []
    for name, pair in examples(pairs):
        titles = (
            f"{name}: {Path(pair.case.file).stem}, step {pair.case.step + 1}",
            f"reference (do nothing {pair.do_nothing.voxel_mse:.3f})",
            f"ours: MSE {pair.figures.voxel_mse:.3f}, IoU {pair.figures.silhouette_iou:.2f}",
        )
        rows.append(((pair.case.before, pair.case.after, pair.outcome), titles))
    draw_rows(rows, path, MARGIN, HIGHEST)


def draw_rows(
    rows: Sequence[tuple[Sequence[FloatArray], Sequence[str]]],
    path: Path,
    margin: float,
    highest: float,
) -> None:
    """Draw square meshes from above, coloured by height, a row for each group of three.

    Args:
        rows: Three states (V, 3) of one unit and their titles.
        path: The picture.
        margin: Left free around a row's states, in their unit.
        highest: Height at which the colours end.
    """
    figure, axes = plt.subplots(len(rows), 3, figsize=(8.4, 3.0 * len(rows)), squeeze=False)
    for (states, titles), line in zip(rows, axes, strict=True):
        corners = np.concatenate(states)[:, :2]
        low, high = corners.min(axis=0) - margin, corners.max(axis=0) + margin
        width = float((high - low).max())
        low = 0.5 * (low + high - width)
        for axis, state, title in zip(line, states, titles, strict=True):
            # x runs down the picture, as the head camera sees the table.
            image = height_image(state, low, width)
            axis.imshow(image, cmap="viridis", vmin=0.0, vmax=highest)
            axis.set_title(title, fontsize=8)
            axis.set_xticks([])
            axis.set_yticks([])
    figure.tight_layout(pad=0.6)
    try:
        with whole_file(path) as temporary:
            figure.savefig(temporary, dpi=100)
    finally:
        plt.close(figure)
