"""Guesses of the next manipulation."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch

from emd_planner.config import PLANNERS
from emd_planner.net_config import SpatialNetConfig
from emd_planner.plan import plan
from emd_planner.proposal import ProposalHead, Proposals
from emd_planner.recipe import proposal_loss
from emd_planner.spatial_net import SpatialEmdNet


def _one(means: list[float], scale: float, both: float) -> Proposals:
    """A mixture of one part."""
    return Proposals(
        torch.zeros(1, 1),
        torch.full((1, 1), both),
        torch.tensor([[means]]),
        torch.full((1, 1, 6), scale),
    )


def test_likelihood_is_that_of_the_normal_distribution():
    """For both hands, six numbers at their mean, and the chance that both grasp."""
    means = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    found = _one(means, 0.1, 20.0).log_likelihood(
        torch.tensor([means]), torch.tensor([[True, True]])
    )
    at_mean = -6.0 * math.log(0.1 * math.sqrt(2.0 * math.pi))
    swapped = torch.distributions.Normal(torch.tensor(means), 0.1).log_prob(
        torch.tensor(means)[[2, 3, 0, 1, 4, 5]]
    )
    expected = torch.logaddexp(torch.tensor(at_mean), swapped.sum())
    torch.testing.assert_close(found, expected[None])


def test_a_hand_that_does_not_grasp_does_not_count():
    """Its point may be anywhere; the order of the hands does not matter either."""
    guess = _one([0.1, 0.2, 0.3, 0.4, 0.5, 0.6], 0.1, -1.0)
    found = [
        guess.log_likelihood(torch.tensor([values]), torch.tensor([used]))
        for values, used in (
            ([0.1, 0.2, 0.9, -0.9, 0.5, 0.6], [True, False]),
            ([0.1, 0.2, 0.3, 0.4, 0.5, 0.6], [True, False]),
            ([-0.8, 0.7, 0.1, 0.2, 0.5, 0.6], [False, True]),
        )
    ]
    at_mean = -4.0 * math.log(0.1 * math.sqrt(2.0 * math.pi))
    expected = torch.tensor([at_mean]) + torch.nn.functional.logsigmoid(torch.tensor(1.0))
    for value in found:
        torch.testing.assert_close(value, expected)
    nothing = guess.log_likelihood(torch.zeros(1, 6), torch.tensor([[False, False]]))
    assert nothing == 0.0


def test_draws_follow_the_distribution():
    """Mean, scale and the share of two hands, and the same seed gives the same."""
    count = 4000
    guess = Proposals(
        torch.tensor([[0.0, -30.0]]).expand(count, -1),
        torch.tensor([[0.0, 9.0]]).expand(count, -1),
        torch.tensor([[[0.5] * 6, [-5.0] * 6]]).expand(count, -1, -1),
        torch.full((count, 2, 6), 0.1),
    )
    values, both = guess.draw(torch.Generator().manual_seed(0))
    torch.testing.assert_close(values.mean(0), torch.full((6,), 0.5), atol=0.01, rtol=0.0)
    torch.testing.assert_close(values.std(0), torch.full((6,), 0.1), atol=0.01, rtol=0.0)
    assert both.float().mean() == pytest.approx(0.5, abs=0.03)
    again, _ = guess.draw(torch.Generator().manual_seed(0))
    assert torch.equal(values, again)


def test_the_head_learns_where_cloth_was_grasped():
    """Trained on moves that equal the shift of a patch, it guesses the shift."""
    torch.manual_seed(0)
    config = SpatialNetConfig(proposals=2)
    head = ProposalHead(2, (8, 8), config)
    optimiser = torch.optim.Adam(head.parameters(), 3e-3)
    steps, used = torch.ones(32, dtype=torch.long), torch.tensor([[True, False]]).expand(32, -1)
    for _ in range(120):
        cells = torch.randint(0, 8, (32, 2, 2))
        codes = torch.zeros(2, 32, 2, 8, 8)
        for state in range(2):
            codes[state, torch.arange(32), 0, cells[:, state, 0], cells[:, state, 1]] = 1.0
        places = (cells + 0.5) / 4.0 - 1.0
        idle = torch.zeros(32, 2)
        manipulations = torch.cat([places[:, 0], idle, places[:, 1] - places[:, 0]], 1)
        guesses = head(codes[0], codes[1], steps, torch.float32)
        loss = -guesses.log_likelihood(manipulations, used).mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    assert loss < 0.5  # a normal distribution as wide as the data has 2.5


def test_nets_learn_guesses_for_every_pair_of_states():
    """The loss has gradients in the head alone; a net without a head has none."""
    net = SpatialEmdNet(SpatialNetConfig(widths=(4, 4, 4), moved_width=2, coarse_blocks=1))
    grids = torch.ones(2, 3, 32, 32, 16, dtype=torch.bool)
    manipulations = torch.rand(2, 2, 6)
    codes = net.encode(grids.flatten(0, 1)).unflatten(0, (2, 3)).detach()
    used = torch.ones(2, 2, 2, dtype=torch.bool)
    loss = proposal_loss(net, codes, manipulations, used)
    loss.backward()
    assert loss > 0.0
    for name, parameter in net.named_parameters():
        assert (parameter.grad is not None) == name.startswith("proposal."), name
    silent = SpatialEmdNet(SpatialNetConfig(proposals=0))
    assert proposal_loss(silent, torch.zeros(2, 3, 48, 16, 16), manipulations, used) == 0.0


def test_a_search_may_begin_with_guesses_alone(grid_of, rectangle):
    """No random start beside them."""
    net = SpatialEmdNet(SpatialNetConfig(widths=(4, 4, 4), moved_width=2, coarse_blocks=1))
    cloth, goal = (grid_of(rectangle((x, 0.0), (0.8, 0.5))) for x in (0.0, 0.2))
    config = replace(PLANNERS["ours"], guessed_share=1.0, candidates=8, max_iterations=2)
    assert len(plan(net, cloth, goal, 1, config).manipulations) == 1
