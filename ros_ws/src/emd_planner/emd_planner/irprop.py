"""iRprop-: steps adapted value by value from the signs of gradients (Igel and Huesken, 2000)."""

from __future__ import annotations

import torch
from torch import Tensor

from emd_planner.config import PlannerConfig


class IrpropMinus:
    """Minimises many independent values at once (paper, III-C).

    A value's step grows by eta+ while its gradient keeps its sign. When the sign flips, the step
    shrinks by eta- and the gradient is forgotten: the value rests for one iteration, and unlike in
    Rprop+ the last move is not taken back.
    """

    def __init__(self, shape: torch.Size, config: PlannerConfig, device: torch.device) -> None:
        """Start with the configured first step everywhere and no gradient remembered."""
        self._config = config
        self._steps = torch.full(shape, config.initial_step, device=device)
        self._last_gradient = torch.zeros(shape, device=device)

    def move(self, gradient: Tensor, rows: Tensor) -> Tensor:
        """Take one step.

        Args:
            gradient: Of the values of the chosen rows, shape (A, ...).
            rows: Indices of these rows among all, shape (A,); the other rows' memory stays.

        Returns:
            What to add to the values, shape (A, ...).
        """
        config = self._config
        agreement = gradient * self._last_gradient[rows]
        factor = torch.ones_like(gradient)
        factor[agreement > 0.0] = config.eta_plus
        factor[agreement < 0.0] = config.eta_minus
        steps = (self._steps[rows] * factor).clamp(config.min_step, config.max_step)
        gradient = torch.where(agreement < 0.0, torch.zeros_like(gradient), gradient)
        self._steps[rows] = steps
        self._last_gradient[rows] = gradient
        return -gradient.sign() * steps
