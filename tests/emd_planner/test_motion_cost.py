"""Costs of where hands grasp and go."""

from __future__ import annotations

import pytest
import torch

from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView
from emd_planner.config import PlannerConfig, ReachConfig
from emd_planner.cost import silhouette_term
from emd_planner.motion_cost import hands_apart_term, hem_term, keep_out_term, short_moves_term
from emd_planner.plan_cost import plan_cost
from emd_planner.reach import ReachLoss

SQUARE = torch.tensor([[0.0, 0.0], [0.4, 0.0], [0.4, 0.4], [0.0, 0.4]])


@pytest.fixture
def cloth(rectangle, grid_of):
    """A flat cloth of 1 x 1 in the middle, boolean (X, Y, Z)."""
    return torch.from_numpy(grid_of(rectangle((0.0, 0.0), (1.0, 1.0))).occupancy)


def _steps(*rows: list[float]) -> torch.Tensor:
    """One step for each restart."""
    return torch.tensor(rows)[:, None]


def test_silhouettes_are_compared_alone(cloth):
    """A taller cloth of the same outline costs nothing, a moved one its columns."""
    tall = cloth.clone()
    tall[cloth[..., 0]] = True
    term = silhouette_term(cloth)
    states = torch.stack([tall, cloth.roll(4, 0)]).float()[:, None]
    same, moved = term(states, torch.zeros(2, 1, 6))
    assert same == 0.0
    assert moved == pytest.approx(2 * 4 * int(cloth[16, :, 0].sum()) / 1024)


def test_hands_grasp_at_the_edge(cloth):
    """The middle costs the distance to the edge; a hand off the cloth costs nothing."""
    term = hem_term(cloth, 0, 0.5)
    values = _steps(
        [0.0, 0.0, 0.9, 0.9, 0.1, 0.0],
        [0.53, 0.0, 0.9, 0.9, 0.1, 0.0],
        [0.53, 0.0, 0.0, 0.3, 0.1, 0.0],
    ).requires_grad_(True)
    middle, edge, second = term(torch.zeros(3, 1, *cloth.shape), values)
    assert middle.item() == pytest.approx(0.45, abs=0.05)
    assert edge.item() == pytest.approx(0.0, abs=0.01)
    assert second.item() == pytest.approx(0.2, abs=0.05)
    (middle + second).backward()
    assert values.grad[2, 0, 3] < 0.0  # farther out is nearer to the edge


def test_regions_are_kept_out_of():
    """Grasp, release and the way between them count by their depth."""
    term = keep_out_term([SQUARE])
    values = _steps(
        [0.2, 0.2, -0.5, -0.5, 0.0, -0.1],
        [-0.1, 0.2, -0.5, -0.5, 0.6, 0.0],
        [-0.5, -0.5, -0.2, -0.2, 0.1, 0.1],
    )
    grasp, passing, free = term(torch.zeros(3, 1, 1, 1, 1), values)
    assert grasp == pytest.approx(0.2)
    assert passing == pytest.approx(0.2)
    assert free == 0.0


def test_short_moves_cost_less():
    """The sum of the displacements' lengths."""
    values = torch.tensor([[[0.0, 0.0, 0.0, 0.0, 0.3, 0.4], [0.0, 0.0, 0.0, 0.0, 0.0, 0.2]]])
    assert short_moves_term()(torch.zeros(1, 2, 1, 1, 1), values) == pytest.approx(0.7)


def test_two_hands_keep_their_distance(cloth):
    """Only if both grasp."""
    term = hands_apart_term(cloth, 0, 0.5, 0.3)
    values = _steps(
        [0.0, 0.0, 0.1, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.4, 0.0, 0.0, 0.0],
        [0.45, 0.0, 0.65, 0.0, 0.0, 0.0],
    )
    near, far, single = term(torch.zeros(3, 1, *cloth.shape), values)
    assert near == pytest.approx(0.2)
    assert far == 0.0 and single == 0.0


def test_arms_that_must_not_cross_take_the_hands_in_order():
    """Each hand is in reach of the other side's arm only: free if arms may cross."""
    fov = FieldOfView()
    half = fov.half_extent
    low = tuple((x * half, y * half) for x, y in ((-1, -1), (1, -1), (1, 0), (-1, 0)))
    high = tuple((x * half, y * half) for x, y in ((-1, 0), (1, 0), (1, 1), (-1, 1)))
    values = torch.tensor([[0.0, -0.5, 0.0, 0.5, 0.1, 0.0]])
    both = torch.tensor([[True, True]])
    crossed = ReachConfig(left=high, right=low)
    assert ReachLoss(crossed, fov, torch.device("cpu"))(values, both) == 0.0
    strict = ReachLoss(crossed, fov, torch.device("cpu"), may_cross=False)
    assert strict(values, both) == pytest.approx(2.0)
    assert strict(values, torch.tensor([[True, False]])) == 0.0
    ordered = ReachLoss(ReachConfig(left=low, right=high), fov, torch.device("cpu"), False)
    assert ordered(values, both) == 0.0


def test_terms_with_a_weight_are_added(cloth):
    """Each weight adds its term, and only what looks back needs every state."""
    fov = FieldOfView()
    values = _steps([0.0, 0.0, 0.1, 0.0, 0.3, 0.4])
    states = torch.zeros(1, 1, *cloth.shape)
    plain = plan_cost(PlannerConfig(grasp_weight=0.0), cloth, cloth, fov)
    assert not plain.needs_every_state and plain.reach is None
    base = plain.total(states, values)
    for weight, expected in (
        ("move_weight", 0.5),
        ("silhouette_weight", float(cloth[..., 0].float().mean())),
        ("hem_weight", 0.45 + 0.4),
        ("hands_apart_weight", 0.08 / fov.half_extent - 0.1),
    ):
        config = PlannerConfig(grasp_weight=0.0, **{weight: 2.0})
        cost = plan_cost(config, cloth, cloth, fov)
        assert cost.needs_every_state
        added = cost.total(states, values) - base
        assert float(added) == pytest.approx(2.0 * expected, abs=0.15), weight
    region = tuple((float(x) * fov.half_extent, float(y) * fov.half_extent) for x, y in SQUARE)
    kept = plan_cost(PlannerConfig(grasp_weight=0.0), cloth, cloth, fov, keep_out=[region])
    assert kept.total(states, values) > base
    with pytest.raises(InvalidInputError, match="corners"):
        plan_cost(PlannerConfig(), cloth, cloth, fov, keep_out=[region[:2]])
