"""Claims about what neat folds leave on the desk: how many layers lie where, and for how long."""

import numpy as np
import pytest

from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.manipulate import manipulate
from emd_cloth_sim.neat_folds import neat_fold
from emd_cloth_sim.presets import preset

MARGIN = 0.015


def cross(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Cross product in the plane, (N, 2) each."""
    return one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]


def layers_over(points: np.ndarray, positions: np.ndarray, triangles: np.ndarray) -> list:
    """Heights of the layers over points (P, 2) of the desk, lowest first, metres."""
    corners = positions[triangles]
    a, b, c = corners[:, 0, :2], corners[:, 1, :2], corners[:, 2, :2]
    area = cross(b - a, c - a)
    area[np.abs(area) < 1e-12] = np.inf
    heights = []
    for point in points:
        u, v = cross(b - point, c - point) / area, cross(c - point, a - point) / area
        over = (u > 0) & (v > 0) & (u + v < 1)
        z = (np.stack([u, v, 1 - u - v], axis=1) * corners[:, :, 2])[over].sum(axis=1)
        heights.append(np.sort(z))
    return heights


def calm_points(fold_positions: np.ndarray, triangles: np.ndarray) -> tuple:
    """Points where an ideal fold has as many layers as all around them, and how many."""
    axis = np.arange(-0.19, 0.2, 0.0237)
    grid = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2) + 1e-4
    turns = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    ring = MARGIN * np.stack([np.cos(turns), np.sin(turns)], axis=-1)
    # A square of the ideal fold may lie on its own mirror image, never across a ray.
    counts = np.array(
        [
            [len(z) for z in layers_over(grid + shift, fold_positions, triangles)]
            for shift in np.vstack([np.zeros((1, 2)), ring])
        ]
    )
    calm = (counts == counts[0]).all(axis=0)
    return grid[calm], counts[0][calm]


CASES = [("half", 41, 1.0)] + [
    pytest.param(name, mesh, 5.0, marks=pytest.mark.slow)
    for name in ("half", "diagonal", "corner", "quarter", "thirds")
    for mesh in (41, 81)
]


@pytest.mark.parametrize(("name", "mesh", "duration"), CASES)
def test_layers_are_right_and_stay(name: str, mesh: int, duration: float) -> None:
    """Rays along the normal meet the right number of layers, after the fold and seconds later."""
    config = preset("towel", (mesh, mesh)).cloth
    fold = neat_fold(name, config)
    cloth = Cloth(config)
    for manipulation in fold.manipulations:
        outcome = manipulate(cloth, manipulation)
        assert not outcome.diagnostics.failure and outcome.held_counts[0] + outcome.held_counts[1]
    points, wanted = calm_points(fold.goal_positions, cloth.triangles)
    assert len(points) > 50 and wanted.max() == {"quarter": 4, "thirds": 3}.get(name, 2)
    # The same state awake: a cloth that never rests may not creep either.
    awake = Cloth.from_positions(
        cloth.positions_in_table, ClothConfig(vertices=(mesh, mesh), settle_speed=1e-12)
    )
    for later in (0.0, duration):
        if later:
            awake.advance(later)
        found = layers_over(points, awake.positions_in_table, cloth.triangles)
        right = [len(z) == count for z, count in zip(found, wanted, strict=True)]
        assert np.mean(right) == 1.0
        gaps = np.concatenate([np.diff(z) for z in found])
        assert gaps.min() > 0.8 * config.thickness


@pytest.mark.parametrize(
    ("sides", "vertices", "thickness"),
    [
        ((0.4, 0.4), (21, 21), 0.003),
        pytest.param((0.4, 0.4), (101, 101), 0.003, marks=pytest.mark.slow),
        ((0.5, 0.2), (51, 21), 0.003),
        ((0.6, 0.05), (61, 6), 0.003),
        ((0.3, 0.4), (31, 61), 0.002),
        ((0.2, 0.1), (41, 21), 0.007),
    ],
)
def test_any_rectangle_folds_in_half(
    sides: tuple[float, float], vertices: tuple[int, int], thickness: float
) -> None:
    """Sheets of any mesh, aspect and thickness, even beyond the spacing, fold in two layers."""
    config = ClothConfig(side_lengths=sides, vertices=vertices, thickness=thickness)
    cloth, fold = Cloth(config), neat_fold("half", config)
    outcome = manipulate(cloth, fold.manipulations[0])
    assert outcome.settled and not outcome.diagnostics.failure
    assert outcome.diagnostics.stretch_p99 < 1.03
    positions = cloth.positions_in_table
    assert positions[:, 2].min() >= 0.5 * thickness - 1e-6
    x = np.linspace(0.35, 0.65, 5) * 0.5 * sides[0]
    y = np.linspace(-0.3, 0.3, 5) * sides[1]
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2) + 1e-4
    found = layers_over(points, positions, cloth.triangles)
    assert [len(z) for z in found] == [2] * len(points)
    np.testing.assert_allclose(np.concatenate([np.diff(z) for z in found]), thickness, rtol=0.3)
