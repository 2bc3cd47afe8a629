"""Search for manipulations by back-propagation (paper, III-C), for any model and cost."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import torch
from torch import Tensor

from emd_planner.config import PlannerConfig
from emd_planner.interruption import TimeIsUp
from emd_planner.irprop import IrpropMinus

Prediction = TypeVar("Prediction")


@dataclass(frozen=True)
class SearchProgress:
    """The search after an iteration.

    Attributes:
        iteration: Iterations done, from 1.
        best_cost: Lowest cost that any restart has had.
        best_values: The values that had it, shape (n, V), normalised.
        active: Restarts that still improve.
    """

    iteration: int
    best_cost: float
    best_values: Tensor
    active: int


@dataclass(frozen=True)
class SearchResult:
    """The best of each restart, best restart first.

    Attributes:
        values: Shape (R, n, V), within the limits.
        costs: Shape (R,), ascending; infinite for a restart whose cost was never finite.
        iterations: Iterations done.
    """

    values: Tensor
    costs: Tensor
    iterations: int


def search(
    predict: Callable[[Tensor], Prediction],
    cost: Callable[[Prediction, Tensor], Tensor],
    initial_values: Tensor,
    config: PlannerConfig,
    on_iteration: Callable[[SearchProgress], None] | None = None,
    watch: Callable[[float], None] | None = None,
    limits: Tensor | None = None,
    initial_costs: Tensor | None = None,
) -> SearchResult:
    """Lower the cost of all restarts side by side with iRprop- (III-C, steps 2 to 6).

    A restart ends when its cost has not improved for `patience` iterations, or when it is
    not in the better half (`halve_every`); the search ends when all restarts have, after
    `max_iterations`, or when time is up. Every restart keeps the best values that it met, so a
    late overshoot costs nothing.

    Args:
        predict: Maps values (A, n, V) of the restarts that still run to a prediction.
        cost: Maps that prediction and the values to costs (A,), differentiable in the values.
        initial_values: One random start per restart, shape (R, n, V).
        config: Steps, limits and bounds.
        on_iteration: Told of the progress after every iteration.
        watch: Asked before every iteration, and by prediction and cost as often as they like. If
            it raises `TimeIsUp`, the search ends with what it has; see
            `emd_planner.interruption.Watch`. It is told to leave the time of two iterations,
            which is about what adjusting the best of what was found takes.
        limits: Largest magnitude of each value, shape (V,); 1 if None.
        initial_costs: Of the starts, shape (R,), if they are known.

    Raises:
        CancelledError: If the watch says so; the best so far was told to `on_iteration`.
    """
    largest = torch.ones(initial_values.shape[-1]) if limits is None else limits
    largest = largest.to(initial_values)
    values = initial_values.clamp(-largest, largest)
    best_values = values.clone()
    best_costs = torch.full((len(values),), torch.inf, device=values.device)
    if initial_costs is not None:
        best_costs[:] = initial_costs
    stale = torch.zeros(len(values), dtype=torch.long, device=values.device)
    rows = torch.arange(len(values), device=values.device)
    optimiser = IrpropMinus(values.shape, config, values.device)
    iteration, took = 0, 0.0
    while iteration < config.max_iterations and len(rows):
        candidate = values[rows].requires_grad_(True)
        began = time.monotonic()
        try:
            if watch is not None:
                watch(2.0 * took)
            costs = cost(predict(candidate), candidate)
            (gradient,) = torch.autograd.grad(costs.sum(), candidate)
        except TimeIsUp:
            break
        iteration += 1
        took = time.monotonic() - began
        costs, candidate = costs.detach(), candidate.detach()
        improved = costs < best_costs[rows] - config.min_improvement
        better = rows[improved]
        best_costs[better], best_values[better] = costs[improved], candidate[improved]
        stale[rows] = torch.where(improved, 0, stale[rows] + 1)
        moved = candidate + optimiser.move(gradient.nan_to_num(), rows)
        values[rows] = moved.clamp(-largest, largest)
        rows = rows[stale[rows] < config.patience]
        if config.halve_every and iteration % config.halve_every == 0:
            rows = _better_half(rows, best_costs)
        if on_iteration is not None:
            best = int(best_costs.argmin())
            on_iteration(
                SearchProgress(
                    iteration, float(best_costs[best]), best_values[best].clone(), len(rows)
                )
            )
    order = best_costs.argsort()
    return SearchResult(best_values[order], best_costs[order], iteration)


def _better_half(rows: Tensor, costs: Tensor) -> Tensor:
    """Keep the half of the rows with the lowest costs, one at least, in their order."""
    return rows[costs[rows].argsort(stable=True)[: (len(rows) + 1) // 2]].sort().values
