"""Terms of a plan's cost."""

from __future__ import annotations

import pytest
import torch

from emd_core.frames import FieldOfView
from emd_planner.config import ReachConfig
from emd_planner.cost import (
    distance_to_silhouette,
    expected_goal_term,
    goal_term,
    grasp_term,
    grasps_cloth,
    reach_term,
    silhouette_term,
    states_before,
    weighted_sum,
)
from emd_planner.reach import ReachLoss

FOV = FieldOfView()


@pytest.fixture
def cloth(rectangle, grid_of):
    """A patch of cloth about the middle, half extents 0.4 and 0.25."""
    return torch.from_numpy(grid_of(rectangle((0.0, 0.0), (0.8, 0.5))).occupancy)


def test_goal_term_looks_at_the_last_state_alone(cloth):
    """States on the way may be anything; the last one is compared with the goal."""
    states = torch.stack([torch.rand(cloth.shape), cloth.float()])[None]
    assert goal_term(cloth)(states, torch.zeros(1, 2, 6)) == 0.0
    assert goal_term(~cloth)(states, torch.zeros(1, 2, 6)) == 1.0


@pytest.mark.parametrize("term", [goal_term, expected_goal_term, silhouette_term])
def test_columns_of_the_goal_that_something_hides_do_not_count(cloth, term):
    """The mean is over the columns that are known; what a state has elsewhere changes nothing."""
    known = torch.ones(cloth.shape[:2], dtype=torch.bool)
    known[10:16] = False
    states = torch.rand(2, 1, *cloth.shape, requires_grad=True)
    cost = term(cloth, known)(states, torch.zeros(2, 1, 6))
    other = term(cloth[known][:, None], None)(states[:, :, known][..., None, :], None)
    torch.testing.assert_close(cost, other)
    cost.sum().backward()
    assert states.grad[:, 0, ~known].abs().max() == 0.0
    assert states.grad[:, 0, known].abs().max() > 0.0
    everywhere = torch.ones_like(known)
    torch.testing.assert_close(term(cloth, everywhere)(states, None), term(cloth)(states, None))


def test_terms_add_up_with_their_weights(cloth):
    """A sum of terms is linear in the weights."""
    states, manipulations = torch.rand(3, 1, *cloth.shape), torch.rand(3, 1, 6)
    goal = goal_term(cloth)
    once, twice = goal(states, manipulations), goal(states, manipulations) * 2.5
    torch.testing.assert_close(
        weighted_sum([(1.0, goal), (1.5, goal)])(states, manipulations), twice
    )
    torch.testing.assert_close(weighted_sum([(1.0, goal)])(states, manipulations), once)


def test_a_hand_grasps_what_lies_under_it_or_near(cloth):
    """On the cloth, or off it by no more than the tolerance, wrapped; farther out it does not."""
    manipulation = torch.tensor([0.0, 0.0, 0.46, 0.0, 0.0, 0.0])
    assert grasps_cloth(manipulation, cloth, 0).tolist() == [True, False]
    assert grasps_cloth(manipulation, cloth, 1).tolist() == [True, True]
    at_the_edge = cloth.roll(14, 0)  # part of it re-enters at the other side
    manipulation = torch.tensor([-0.95, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert grasps_cloth(manipulation, at_the_edge, 0).tolist() == [True, False]


def test_the_state_before_each_step_is_the_one_after_the_last(cloth):
    """The first is the actual initial state, the others are predictions, thresholded."""
    states = torch.rand(2, 3, *cloth.shape)
    before = states_before(cloth, states, 0.5)
    assert before.shape == states.shape
    assert torch.equal(before[0, 0], cloth)
    assert torch.equal(before[:, 1:], states[:, :-1] >= 0.5)


def test_a_step_without_a_grasp_costs_the_distance_to_the_cloth(cloth):
    """0 while a hand is on the cloth, else the way of the nearer hand, with a gradient back."""
    term = grasp_term(cloth, tolerance_voxels=0, threshold=0.5)
    states = torch.zeros(2, 1, *cloth.shape)
    on, off = [0.0, 0.0], [0.7, 0.0]
    steps = torch.tensor([[[*on, *off, 0.3, 0.0]], [[*off, 0.0, 0.9, 0.3, 0.0]]])
    steps.requires_grad_()
    cost = term(states, steps)
    assert cost[0] == 0.0
    assert cost[1].item() == pytest.approx(0.7 - 0.4, abs=0.04)
    (gradient,) = torch.autograd.grad(cost.sum(), steps)
    assert gradient[0].abs().max() == 0.0
    assert gradient[1, 0, 0].item() == pytest.approx(1.0, abs=0.01)


def test_distance_to_a_silhouette_equals_brute_force():
    """The nearest column's centre over all nine periodic copies; 0 if there is no cloth."""
    silhouette = torch.rand(3, 32, 32, generator=torch.Generator().manual_seed(0)) > 0.99
    silhouette[2] = False
    points = torch.rand(3, 4, 2, generator=torch.Generator().manual_seed(1)) * 2 - 1
    got = distance_to_silhouette(points, silhouette)
    shifts = torch.cartesian_prod(*[torch.tensor([-2.0, 0.0, 2.0])] * 2)
    for row in range(2):
        centres = (torch.nonzero(silhouette[row]) + 0.5) / 16 - 1
        copies = (centres[:, None] + shifts).reshape(-1, 2)
        wanted = (points[row][:, None] - copies).norm(dim=-1).amin(1)
        torch.testing.assert_close(got[row], wanted)
    assert (got[2] == 0.0).all()


def test_reach_constrains_only_hands_that_grasp(cloth):
    """A hand off the cloth may be anywhere, in each step by the state before that step."""
    side = 0.3 * FOV.half_extent
    square = ((-side, -side), (side, -side), (side, side), (-side, side))
    reach = ReachLoss(ReachConfig(square, square), FOV, torch.device("cpu"))
    term = reach_term(reach, cloth, tolerance_voxels=0, threshold=0.5)
    inside, outside = [0.1, 0.1], [0.9, 0.9]
    steps = torch.tensor([[[*inside, *outside, 0.0, 0.0], [*inside, *inside, 0.5, 0.0]]])
    states = torch.zeros(1, 2, *cloth.shape)
    states[0, 0] = cloth
    torch.testing.assert_close(term(states, steps), torch.tensor([2 * 0.3]))
    states[0, 0] = 0.0  # nothing to grasp in the second step
    assert term(states, steps) == 0.0
