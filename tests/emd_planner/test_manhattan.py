"""The Manhattan update (paper, eq. 3)."""

from __future__ import annotations

import pytest
import torch
from torch import nn

from emd_core.errors import InvalidInputError
from emd_planner.manhattan import Manhattan


def test_step_equals_equation_3_worked_by_hand():
    """Agreeing signs move by 2 eta, one zero by eta, differing signs not at all; downhill."""
    weight = nn.Parameter(torch.zeros(5))
    rule = Manhattan([weight], learning_rate=0.1)
    rule.step(
        [torch.tensor([3.0, -0.2, 5.0, 0.0, 0.0])], [torch.tensor([0.1, -9.0, -1.0, 2.0, 0.0])]
    )
    torch.testing.assert_close(weight.data, torch.tensor([-0.2, 0.2, 0.0, -0.1, 0.0]))


def test_gradients_of_both_losses_stay_apart():
    """Each loss is differentiated alone; a weight that a loss does not touch has None."""
    shared, only_first = nn.Parameter(torch.ones(2)), nn.Parameter(torch.ones(2))
    rule = Manhattan([shared, only_first], learning_rate=0.5)
    first = rule.gradients((shared * only_first).sum() * 4.0, retain_graph=True)
    second = rule.gradients((-2.0 * shared).sum())
    assert second[1] is None
    rule.step(first, second)
    torch.testing.assert_close(shared.data, torch.ones(2))
    torch.testing.assert_close(only_first.data, torch.full((2,), 0.5))


def test_it_minimises_a_quadratic_to_within_its_step():
    """Two losses with one optimum are brought there, to within two steps."""
    target = torch.tensor([0.3, -0.7])
    weight = nn.Parameter(torch.zeros(2))
    rule = Manhattan([weight], learning_rate=0.01)
    for _ in range(100):
        loss = (weight - target).square().sum()
        rule.step(rule.gradients(loss, retain_graph=True), rule.gradients(3.0 * loss))
    assert (weight.data - target).abs().max() <= 0.02 + 1e-6


def test_bad_arguments_are_refused():
    """A learning rate of zero and a missing gradient are said to be wrong."""
    with pytest.raises(InvalidInputError, match="learning rate"):
        Manhattan([nn.Parameter(torch.zeros(1))], learning_rate=0.0)
    with pytest.raises(InvalidInputError, match="per weight"):
        Manhattan([nn.Parameter(torch.zeros(1))], learning_rate=0.1).step([], [])
