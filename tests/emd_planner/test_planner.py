"""The search on problems whose best answer is known (paper, III-C)."""

from __future__ import annotations

import math
import time

import pytest
import torch

from emd_core.errors import CancelledError, InvalidInputError
from emd_planner.config import PlannerConfig
from emd_planner.interruption import Watch
from emd_planner.planner import search
from emd_planner.starts import random_values

TARGET = torch.tensor([[0.2, -0.4, 0.7, 0.1, -0.9, 0.5], [0.0, 0.3, -0.6, 0.8, 0.4, -0.2]])


def _starts(seed: int = 0, restarts: int = 10) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    return random_values(restarts, 2, None, generator, torch.device("cpu"))


def _distance(prediction: torch.Tensor, values: torch.Tensor) -> torch.Tensor:
    return (prediction - TARGET).square().flatten(1).sum(1)


def _bumpy(prediction: torch.Tensor, values: torch.Tensor) -> torch.Tensor:
    """A Rastrigin function with its global minimum at TARGET."""
    offset = prediction - TARGET
    return (offset.square() + 0.05 * (1 - torch.cos(9.0 * offset))).flatten(1).sum(1)


def test_known_optimum_is_found():
    """On a convex problem every restart ends at the optimum."""
    result = search(lambda values: values, _distance, _starts(), PlannerConfig())
    torch.testing.assert_close(result.values, TARGET.expand_as(result.values), atol=1e-2, rtol=0.0)
    assert result.costs.max() < 1e-3


def test_restarts_find_what_one_start_misses():
    """On a bumpy problem the best of many restarts beats the typical one; it comes first."""
    result = search(lambda values: values, _bumpy, _starts(restarts=40), PlannerConfig())
    assert (result.costs[:-1] <= result.costs[1:]).all()
    assert result.costs[0] < 0.5 * result.costs.median()
    torch.testing.assert_close(result.costs, _bumpy(result.values, result.values))


def test_values_stay_in_range_even_if_the_optimum_lies_outside():
    """An optimum beyond 1 is approached up to the border."""
    result = search(
        lambda values: values,
        lambda prediction, values: (prediction - 3.0).square().flatten(1).sum(1),
        _starts(),
        PlannerConfig(),
    )
    torch.testing.assert_close(result.values, torch.ones_like(result.values))


def test_halving_keeps_the_best_restarts_only():
    """Every few iterations the worse half of the restarts ends, and the best one goes on."""
    running = []

    def predict(values):
        running.append(len(values))
        return values

    config = PlannerConfig(halve_every=5, min_improvement=-math.inf, patience=1000)
    halved = search(predict, _bumpy, _starts(), config)
    assert running[::5][:6] == [10, 5, 3, 2, 1, 1] and running[4] == 10
    leading = search(
        lambda values: values, _bumpy, _starts(), PlannerConfig(max_iterations=5, patience=1000)
    )
    assert halved.costs[0] <= leading.costs[0] and len(halved.costs) == 10


def test_search_ends_after_25_iterations_without_improvement():
    """A flat cost ends after the first iteration and the patience, others after at most 100."""

    def flat(prediction, values):
        return 0.0 * prediction.flatten(1).sum(1)

    assert search(lambda values: values, flat, _starts(), PlannerConfig()).iterations == 26
    counted = []
    config = PlannerConfig(min_improvement=-math.inf)
    search(lambda v: v, _distance, _starts(), config, lambda p: counted.append(p.iteration))
    assert counted == list(range(1, 101))


def test_restarts_that_ended_are_no_longer_computed():
    """The batch shrinks to the restarts that still improve, each with its own patience."""
    sizes = []

    def predict(values):
        sizes.append(len(values))
        return values

    def cost(prediction, values):
        moving = values[:, 0, 0] > 0.0
        return torch.where(moving, prediction.square().flatten(1).sum(1), prediction.sum() * 0.0)

    search(predict, cost, _starts(), PlannerConfig(patience=5))
    assert sizes[0] == 10
    assert sizes[-1] < 10


def test_best_so_far_only_gets_better_and_is_told():
    """Each iteration tells the best cost yet and the values that have it."""
    told = []
    search(lambda values: values, _bumpy, _starts(), PlannerConfig(), told.append)
    costs = [progress.best_cost for progress in told]
    assert costs == sorted(costs, reverse=True)
    last = told[-1].best_values[None]
    assert float(_bumpy(last, last)) == pytest.approx(costs[-1])


def test_cancelling_stops_before_the_next_iteration():
    """After the caller asks to stop, the model is not run again."""
    runs = []

    def predict(values):
        runs.append(1)
        return values

    watch = Watch(lambda: len(runs) == 3, math.inf)
    with pytest.raises(CancelledError):
        search(predict, _bumpy, _starts(), PlannerConfig(), watch=watch)
    assert len(runs) == 3


def test_time_that_is_up_ends_the_search_with_the_best_so_far(monkeypatch):
    """The time of two iterations is left; one in whose middle time is up does not count."""
    now, lasts = [0.0], [1.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    watch = Watch(None, 4.5)

    def predict(values):
        now[0] += lasts[0]
        watch()
        return values

    starts = _starts()
    result = search(predict, _distance, starts, PlannerConfig(), watch=watch)
    assert result.iterations == 3 and now[0] == 3.0
    assert result.costs.isfinite().all()
    lasts[0] = 2.0
    known = _distance(starts, starts)
    none = search(predict, _distance, starts, PlannerConfig(), None, watch, None, known)
    assert none.iterations == 0
    assert torch.equal(none.costs, known.sort().values)
    unknown = search(predict, _distance, starts, PlannerConfig(), watch=watch)
    assert unknown.costs.isinf().all()


def test_a_cost_that_is_not_a_number_never_wins():
    """A restart with NaN cost ends last and does not spoil the others."""

    def cost(prediction, values):
        spoiled = _distance(prediction, values)
        return torch.where(values[:, 0, 0] > 0.0, spoiled, torch.nan * spoiled)

    result = search(lambda values: values, cost, _starts(), PlannerConfig())
    assert result.costs[0].isfinite()
    assert result.values.isfinite().all()


def test_starts_lie_on_the_cloth_and_depend_on_the_seed():
    """Grasp points start on the silhouette, displacements anywhere in [-1, 1]."""
    silhouette = torch.zeros(32, 32, dtype=torch.bool)
    silhouette[4:8, 20:30] = True
    one, same, other = (
        random_values(50, 2, silhouette, torch.Generator().manual_seed(s), torch.device("cpu"))
        for s in (1, 1, 2)
    )
    assert torch.equal(one, same)
    assert not torch.equal(one, other)
    x, y = one[..., [0, 2]], one[..., [1, 3]]
    assert (x >= -0.75).all() and (x < -0.5).all()
    assert (y >= 0.25).all() and (y < 0.875).all()
    assert one[..., 4:].std() > 0.5


@pytest.mark.parametrize(
    "values",
    [
        {"goal_cost": "best"},
        {"restarts": 0},
        {"guessed_share": 1.5},
        {"hem_weight": -1.0},
        {"reach_weight": math.nan},
    ],
)
def test_settings_out_of_range_are_refused(values):
    """The setting is named."""
    with pytest.raises(InvalidInputError, match=next(iter(values))):
        PlannerConfig(**values)
