"""Reach limits (paper, V-B)."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView
from emd_planner.config import ReachConfig
from emd_planner.reach import ReachLoss, distance_to_polygon, normalised_polygon

FOV = FieldOfView()
PENTAGON = ((0.0, 0.0), (0.2, -0.05), (0.3, 0.1), (0.15, 0.25), (-0.05, 0.12))
BOTH = torch.tensor([True, True])


def _brute_force(point: np.ndarray, corners: np.ndarray, samples: int = 4000) -> float:
    """Distance by sampling the border; 0 if a fan of triangles covers the point."""
    for i in range(1, len(corners) - 1):
        triangle = np.column_stack([corners[[0, i, i + 1]], np.ones(3)])
        if (np.linalg.solve(triangle.T, [*point, 1.0]) >= 0).all():
            return 0.0
    t = np.linspace(0.0, 1.0, samples)[:, None]
    border = np.concatenate(
        [a + t * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    )
    return float(np.linalg.norm(border - point, axis=1).min())


def test_distance_equals_brute_force():
    """0 inside and the distance to the border outside, as sampling the border gives it."""
    corners = normalised_polygon(PENTAGON, FOV)
    points = np.random.default_rng(0).uniform(-1.0, 1.5, (200, 2))
    wanted = [_brute_force(point, corners.double().numpy()) for point in points]
    got = distance_to_polygon(torch.from_numpy(points).float(), corners)
    assert min(wanted) == 0.0
    np.testing.assert_allclose(got.numpy(), wanted, atol=1e-3)


def test_gradient_is_zero_inside_and_of_unit_length_outside():
    """Points are pushed straight back when out, left alone when in, finite on the border."""
    corners = normalised_polygon(PENTAGON, FOV)
    points = torch.tensor([[0.3, 0.3], [1.4, 0.5], [-0.5, -0.5]], requires_grad=True)
    distance_to_polygon(points, corners).sum().backward()
    torch.testing.assert_close(points.grad.norm(dim=1), torch.tensor([0.0, 1.0, 1.0]))
    border = ((corners + corners.roll(-1, 0)) / 2).requires_grad_()
    distance_to_polygon(torch.cat([border, corners]), corners).sum().backward()
    assert border.grad.isfinite().all()


def test_corners_may_run_either_way_round():
    """Clockwise and counter-clockwise corners name the same region."""
    points = torch.rand(50, 2) * 3 - 1
    one = distance_to_polygon(points, normalised_polygon(PENTAGON, FOV))
    other = distance_to_polygon(points, normalised_polygon(PENTAGON[::-1], FOV))
    torch.testing.assert_close(one, other)


@pytest.fixture
def loss():
    """Left arm: y < 0; right arm: y > 0; both 0.2 m wide, normalised for convenience."""
    side = 0.5 * FOV.half_extent
    return ReachLoss(
        ReachConfig(
            left=((-side, -side), (side, -side), (side, 0.0), (-side, 0.0)),
            right=((-side, 0.0), (side, 0.0), (side, side), (-side, side)),
        ),
        FOV,
        torch.device("cpu"),
    )


def test_loss_is_zero_when_both_hands_stay_in_reach_in_either_order(loss):
    """Which point is first does not matter: the arms are assigned for the better."""
    assert loss(torch.tensor([0.1, -0.2, 0.1, 0.2, 0.1, 0.0]), BOTH) == 0.0
    assert loss(torch.tensor([0.1, 0.2, 0.1, -0.2, 0.1, 0.0]), BOTH) == 0.0


def test_loss_is_the_distance_of_grasp_and_release_points(loss):
    """Each point that is out adds its distance: here a release 0.2 beyond the edge."""
    manipulation = torch.tensor([0.4, -0.2, 0.1, 0.2, 0.3, 0.0])
    torch.testing.assert_close(loss(manipulation, BOTH), torch.tensor(0.2))


def test_two_hands_on_one_side_cost_the_better_assignment(loss):
    """With both points on the left arm's side one of them is too far for the right arm."""
    manipulation = torch.tensor([0.0, -0.1, 0.0, -0.4, 0.0, 0.0])
    torch.testing.assert_close(loss(manipulation, BOTH), torch.tensor(2 * 0.1))


def test_unused_hand_is_not_constrained(loss):
    """A point off the cloth may lie anywhere; the other hand may be either arm."""
    manipulation = torch.tensor([0.0, -0.1, 5.0, 5.0, 0.0, 0.0])
    assert loss(manipulation, torch.tensor([True, False])) == 0.0
    manipulation[1] = 0.1
    assert loss(manipulation, torch.tensor([True, False])) == 0.0


def test_following_the_gradient_brings_points_into_reach(loss):
    """The loss pushes wandering points back until it is zero."""
    manipulation = torch.tensor([0.9, -0.7, -0.8, 0.9, 0.4, 0.3])
    for _ in range(400):
        manipulation = manipulation.detach().requires_grad_()
        value = loss(manipulation, BOTH)
        if value == 0.0:
            break
        (gradient,) = torch.autograd.grad(value, manipulation)
        manipulation = manipulation - 0.01 * gradient
    assert loss(manipulation, BOTH) == 0.0


@pytest.mark.parametrize(
    "polygon",
    [
        ((0.0, 0.0), (1.0, 0.0)),
        ((0.0, 0.0), (1.0, 0.0), (2.0, 0.0)),
        ((0.0, 0.0), (1.0, 0.0), (0.2, 0.2), (0.0, 1.0)),
        ((0.0, 1.0), (0.6, -0.8), (-0.95, 0.3), (0.95, 0.3), (-0.6, -0.8)),
        ((0.0, 0.0), (1.0, 0.0), (float("nan"), 1.0)),
    ],
)
def test_polygons_that_are_not_convex_are_refused(polygon):
    """Too few corners, no area, a notch, a star and NaN are refused."""
    with pytest.raises(InvalidInputError, match="reach polygon"):
        normalised_polygon(polygon, FOV)


def test_default_regions_are_mirror_images_and_hold_the_middle():
    """Left works mainly at y < 0, right mirrored; both reach the middle of the table."""
    config = ReachConfig()
    mirrored = {(x, -y) for x, y in config.left}
    assert mirrored == set(config.right)
    middle = torch.zeros(2)
    for polygon in (config.left, config.right):
        assert distance_to_polygon(middle, normalised_polygon(polygon, FOV)) == 0.0
    far = torch.tensor([-0.15, -0.25]) / FOV.half_extent
    left, right = (normalised_polygon(p, FOV) for p in (config.left, config.right))
    assert distance_to_polygon(far, left) < 0.01 < distance_to_polygon(far, right)
