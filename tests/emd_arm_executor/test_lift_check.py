"""Seeing whether hands took the cloth along, on cloths whose fate is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from emd_arm_executor.config import SightConfig
from emd_arm_executor.grasp import GraspPose
from emd_arm_executor.hem import Hem
from emd_arm_executor.lift_check import changed_share, hem_moved
from emd_arm_executor.observed_silhouette import silhouette_from_points
from emd_arm_executor.silhouette import Silhouette
from emd_core.frames import FloatArray

CONFIG = SightConfig()
HEM, CORNER = np.array([-0.2, 0.03]), np.array([-0.2, -0.2])


def seen(points: FloatArray, seed: int) -> Silhouette:
    """A silhouette of noisy points: the depth's 2 mm, and half of it sideways."""
    noise = np.random.default_rng(seed).normal(0.0, [0.001, 0.001, 0.002], points.shape)
    return silhouette_from_points(points + noise)


def sheet(side: float = 0.40, step: float = 0.0025) -> FloatArray:
    """Points (N, 3) on a square cloth in the middle of the table, metres."""
    axis = np.arange(-side / 2, side / 2 + step / 2, step)
    x, y = np.meshgrid(axis, axis, indexing="ij")
    return np.stack([x.ravel(), y.ravel(), np.full(x.size, 0.003)], axis=1)


def folded(points: FloatArray, corner: FloatArray, length: float) -> FloatArray:
    """Reflect what lies outside the crease of a fold that takes a place inwards by a length."""
    along = -corner / np.linalg.norm(corner)
    beyond = (points[:, :2] - corner) @ along - length / 2.0
    result = points.copy()
    result[:, :2] -= 2.0 * np.minimum(beyond, 0.0)[:, None] * along
    return result


@pytest.mark.parametrize("place", [HEM, CORNER])
@pytest.mark.parametrize("seed", range(5))
def test_a_hem_seen_twice_has_not_moved(place: FloatArray, seed: int) -> None:
    """The camera's noise at the hem is far from what counts as moved, nudges of 2 mm too."""
    before, nudged = seen(sheet(), seed), sheet() + np.array([0.002, 0.0, 0.0])
    for points in (sheet(), nudged):
        share = changed_share(before, seen(points, seed + 100), place, CONFIG.radius)
        assert share < 0.8 * CONFIG.moved_share


@pytest.mark.parametrize("place", [HEM, CORNER])
@pytest.mark.parametrize("length", [0.042, 0.10, 0.40])
def test_a_folded_hem_has_moved(place: FloatArray, length: float) -> None:
    """A fold bares the table; the shortest carries the hem 42 mm: 10 mm and twice the grip."""
    after = seen(folded(sheet(), place, length), 1)
    assert changed_share(seen(sheet(), 0), after, place, CONFIG.radius) > 0.8


def test_a_hem_that_was_pulled_has_moved() -> None:
    """A cloth that was pulled outwards by the shortest way that is judged covers what was bare."""
    after = seen(sheet() + np.array([-CONFIG.radius, 0.0, 0.0]), 1)
    assert changed_share(seen(sheet(), 0), after, HEM, CONFIG.radius) > CONFIG.moved_share


def grasp_at(place: FloatArray) -> GraspPose:
    """A hand that grips a hem from outside."""
    outward = place / np.linalg.norm(place)
    hem = Hem(place, outward, 0.0, True, (0, 0))
    return GraspPose(hem, np.array([*place, 0.004]), -outward)


def test_each_hand_is_judged_at_its_own_hem() -> None:
    """Where one corner was folded and the other left, each is told."""
    grasps = {"left": grasp_at(np.array([-0.2, 0.2])), "right": grasp_at(CORNER)}
    after = seen(folded(sheet(), CORNER, 0.2), 1)
    assert hem_moved(grasps, seen(sheet(), 0), after) == {"left": False, "right": True}


@pytest.mark.parametrize("when", ["before", "after"])
def test_a_hem_that_something_hides_is_not_judged(when: str) -> None:
    """Cloth may be gone or out of sight; where only little is hidden, that is left out."""
    cloth = seen(sheet(), 0)
    grasps = {"left": grasp_at(HEM)}
    for radius, judged in ((0.03, {}), (0.005, {"left": False})):
        x, y = np.indices(cloth.mask.shape)
        centres = cloth.origin_in_table + (np.stack([x, y], -1) + 0.5) * cloth.resolution
        unknown = np.linalg.norm(centres - HEM, axis=-1) < radius
        hidden = replace(cloth, mask=cloth.mask & ~unknown, unknown=unknown)
        pair = (hidden, cloth) if when == "before" else (cloth, hidden)
        assert hem_moved(grasps, *pair) == judged


def test_cloth_that_is_gone_has_moved(towel: Callable[..., Silhouette]) -> None:
    """Places outside the raster of what is seen later are bare."""
    away = Silhouette(np.ones((2, 2), dtype=bool), np.array([0.01, 0.01]), np.array([0.3, 0.3]))
    assert changed_share(towel(), away, HEM, CONFIG.radius) == 1.0
