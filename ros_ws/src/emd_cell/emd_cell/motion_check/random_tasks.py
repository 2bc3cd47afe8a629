"""Seeded random cloths on the table and manipulations of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from emd_arm_executor.silhouette import Silhouette
from emd_core.frames import FloatArray
from emd_core.manipulation import Manipulation

_CELL = 0.004
_EXTENT = 0.44


@dataclass(frozen=True)
class MotionTask:
    """What the arms are asked to do.

    Attributes:
        kind: "fold" (from a hem inwards) or "random" (any point, any direction).
        manipulation: In the table frame.
        silhouette: The cloth, a square as it is or folded once.
    """

    kind: str
    manipulation: Manipulation
    silhouette: Silhouette


def random_task(seed: int, index: int) -> MotionTask:
    """Make task number `index`; the same seed and index give the same task.

    Cloths are 0.30 to 0.40 m wide, within 3 cm of the table frame's origin, at any angle, one in
    four folded in half. Folds grasp one hem 0 to 2 cm inside it and move inwards by 0.05 m up to
    the cloth's width, within 30 degrees of its normal. Random manipulations grasp anywhere on the
    cloth and move anywhere by 0.05 to 0.40 m, as in the authors' generator. Half of both use two
    hands.
    """
    rng = np.random.default_rng((seed, index))
    side = rng.uniform(0.30, 0.40)
    size = np.array([side, side / 2.0 if rng.random() < 0.25 else side])
    centre, angle = rng.uniform(-0.03, 0.03, 2), rng.uniform(-np.pi, np.pi)
    layers = 1 if size[1] == side else 2
    silhouette = _rectangle(size, centre, angle, 0.002 * layers)
    kind = "fold" if rng.random() < 0.5 else "random"
    two = bool(rng.random() < 0.5)
    points, displacement = (random_fold if kind == "fold" else _anywhere)(rng, size, two)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    rows = np.full((2, 2), np.nan)
    rows[: len(points)] = centre + points @ turn.T
    return MotionTask(kind, Manipulation(rows, turn @ displacement), silhouette)


def random_fold(
    rng: np.random.Generator, size: FloatArray, two: bool
) -> tuple[FloatArray, FloatArray]:
    """Grasp near the hem at -y (or -x) of a cloth and move inwards.

    Args:
        rng: Draws everything.
        size: Of the flat cloth along the axes of its own frame, in its middle, metres.
        two: Whether both hands are used.

    Returns:
        Grasp points (1 or 2, 2) and displacement (2,), metres.
    """
    across = int(rng.integers(2))  # the axis along which the cloth is folded
    along = size[1 - across] / 2.0
    inset = rng.uniform(0.0, 0.02)
    offsets = np.sort(rng.uniform(-along, along, 2))
    if two and offsets[1] - offsets[0] < 0.15:
        offsets = np.array([-0.9, 0.9]) * along
    points = np.zeros((2 if two else 1, 2))
    points[:, across] = inset - size[across] / 2.0
    points[:, 1 - across] = offsets[: len(points)]
    turn, length = rng.uniform(-np.pi / 6, np.pi / 6), rng.uniform(0.05, size[across])
    displacement = np.zeros(2)
    displacement[across], displacement[1 - across] = np.cos(turn), np.sin(turn)
    return points, length * displacement


def _anywhere(
    rng: np.random.Generator, size: FloatArray, two: bool
) -> tuple[FloatArray, FloatArray]:
    """Grasp anywhere on the cloth and move anywhere."""
    points = rng.uniform(-size / 2.0, size / 2.0, (2 if two else 1, 2))
    turn, length = rng.uniform(-np.pi, np.pi), rng.uniform(0.05, 0.40)
    return points, length * np.array([np.cos(turn), np.sin(turn)])


def _rectangle(size: FloatArray, centre: FloatArray, angle: float, height: float) -> Silhouette:
    axis = np.arange(-_EXTENT + _CELL / 2, _EXTENT, _CELL)
    x, y = np.meshgrid(axis - centre[0], axis - centre[1], indexing="ij")
    along = np.cos(angle) * x + np.sin(angle) * y
    across = np.cos(angle) * y - np.sin(angle) * x
    mask = (np.abs(along) < size[0] / 2.0) & (np.abs(across) < size[1] / 2.0)
    corner = np.array([-_EXTENT, -_EXTENT])
    return Silhouette(mask, np.array([_CELL, _CELL]), corner, np.where(mask, height, 0.0))
