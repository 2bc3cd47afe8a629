"""Claims about the geometry of contacts, against dense sampling."""

import numpy as np
import pytest
from numba import njit

from emd_cloth_sim.closest_points import closest_on_segments as segments_kernel
from emd_cloth_sim.closest_points import closest_on_triangle as triangle_kernel
from emd_cloth_sim.contact import collide_with_desk
from emd_cloth_sim.step_data import UNBOUNDED


@njit
def closest_on_triangle(points: np.ndarray) -> tuple[float, float, float]:
    """Call the inlined kernel for vertex 0 and the triangle 1, 2, 3."""
    x, y, z = points[0]
    return triangle_kernel(x, y, z, points, 1, 2, 3)


@njit
def closest_on_segments(points: np.ndarray) -> tuple[float, float, float, float, float, float]:
    """Call the inlined kernel for the segments 0-1 and 2-3."""
    return segments_kernel(points, 0, 1, 2, 3)


@pytest.mark.parametrize("seed", range(30))
def test_no_point_of_a_triangle_is_closer(seed: int) -> None:
    """The weights are barycentric and no sampled point of the triangle is closer."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(4, 3))
    weights = np.array(closest_on_triangle(points))
    assert (weights >= 0).all() and np.isclose(weights.sum(), 1)
    samples = rng.dirichlet([0.5, 0.5, 0.5], 4000) @ points[1:]
    distance = np.linalg.norm(weights @ points[1:] - points[0])
    sampled = np.linalg.norm(samples - points[0], axis=1).min()
    assert distance <= sampled + 1e-9 and sampled - distance < 0.1


@pytest.mark.parametrize("seed", range(30))
def test_no_points_of_two_segments_are_closer(seed: int) -> None:
    """The parameters are within the segments and no sampled pair of points is closer."""
    points = np.random.default_rng(seed).normal(size=(4, 3))
    s, t, *gap, _ = closest_on_segments(points)
    assert 0 <= s <= 1 and 0 <= t <= 1
    share = np.linspace(0, 1, 200)[:, None]
    one = points[0] + share * (points[1] - points[0])
    other = points[2] + share * (points[3] - points[2])
    sampled = np.linalg.norm(one[:, None] - other[None], axis=2).min()
    assert np.linalg.norm(gap) <= sampled + 1e-9 and sampled - np.linalg.norm(gap) < 0.02


def test_desk_friction_is_bounded_by_the_push() -> None:
    """A vertex pushed out of the desk by d is braked by at most friction * d."""
    previous = np.zeros((2, 3), dtype=np.float32)
    position = np.array([[0.010, 0.0, -0.002], [0.0005, 0.0, -0.002]], np.float32)
    collide_with_desk(position, previous, np.float32(0.0), np.float32(0.5), np.float32(UNBOUNDED))
    np.testing.assert_allclose(position, [[0.009, 0.0, 0.0], [0.0, 0.0, 0.0]], atol=1e-9)
