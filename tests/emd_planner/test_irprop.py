"""iRprop-."""

from __future__ import annotations

import torch

from emd_planner.config import PlannerConfig
from emd_planner.irprop import IrpropMinus

CONFIG = PlannerConfig(initial_step=0.1, max_step=0.3, min_step=0.01)


def _moves(gradients: list[float]) -> list[float]:
    optimiser = IrpropMinus(torch.Size([1]), CONFIG, torch.device("cpu"))
    row = torch.tensor([0])
    return [round(float(optimiser.move(torch.tensor([g]), row)[0]), 6) for g in gradients]


def test_steps_follow_the_signs_as_worked_by_hand():
    """X 2.0 while the sign stays, x 0.33 and a rest when it flips; only signs count."""
    assert _moves([5.0, 0.1, -3.0, -3.0, -3.0]) == [-0.1, -0.2, 0.0, 0.066, 0.132]


def test_steps_stay_within_their_bounds():
    """Steps grow to max_step and shrink to min_step at most."""
    assert _moves([1.0] * 5)[-1] == -0.3
    assert min(abs(move) for move in _moves([1.0, -1.0] * 20) if move) == 0.01


def test_it_finds_the_minimum_of_an_ill_conditioned_quadratic():
    """Curvatures of 1 to 10000 do not matter to a rule that looks at signs."""
    target = torch.tensor([0.3, -0.5, 0.9])
    curvature = torch.tensor([1.0, 100.0, 10000.0])
    config = PlannerConfig(min_step=1e-8)
    optimiser = IrpropMinus(torch.Size([1, 3]), config, torch.device("cpu"))
    values, row = torch.zeros(1, 3), torch.tensor([0])
    for _ in range(100):
        values = values + optimiser.move(2.0 * curvature * (values - target), row)
    torch.testing.assert_close(values[0], target, atol=1e-4, rtol=0.0)


def test_rows_left_out_keep_their_steps():
    """A restart that rests neither moves nor forgets its step."""
    optimiser = IrpropMinus(torch.Size([2, 1]), CONFIG, torch.device("cpu"))
    both, second = torch.tensor([0, 1]), torch.tensor([1])
    optimiser.move(torch.ones(2, 1), both)
    optimiser.move(torch.ones(1, 1), second)
    last = optimiser.move(torch.ones(2, 1), both)
    torch.testing.assert_close(last, torch.tensor([[-0.2], [-0.3]]))
