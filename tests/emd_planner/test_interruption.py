"""Searches that end between two layers of a net."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import pytest
import torch

from emd_core.errors import CancelledError, NoPlanError
from emd_planner.config import PLANNERS, PlannerConfig
from emd_planner.interruption import TimeIsUp, ask_between_layers
from emd_planner.net_config import SpatialNetConfig
from emd_planner.plan import plan
from emd_planner.planning_net import planning_copy
from emd_planner.spatial_net import SpatialEmdNet

SMALL = SpatialNetConfig(widths=(4, 4, 4), moved_width=2, coarse_blocks=1)


@pytest.fixture
def net():
    """A small net that has learned nothing."""
    return SpatialEmdNet(SMALL).requires_grad_(False)


@pytest.fixture
def grids(rectangle, grid_of):
    """A patch and the same elsewhere."""
    return [grid_of(rectangle((x, 0.0), (0.8, 0.5))) for x in (0.0, 0.4)]


def test_a_net_asks_in_prediction_and_back_propagation(net, grids):
    """Often, and what the watch raises ends either; the net it was copied from never asks."""
    copied, asked, last = planning_copy(net, bfloat16=False), [], [math.inf]

    def watch():
        asked.append(1)
        if len(asked) > last[0]:
            raise TimeIsUp

    ask_between_layers(copied, watch)
    states = torch.from_numpy(grids[0].occupancy)[None]
    values = torch.zeros(1, 1, 6, requires_grad=True)
    predicted = copied.predict(states, values).sum()
    forward = len(asked)
    torch.autograd.grad(predicted, values)
    assert forward > 15 and len(asked) > forward + 10
    asked.clear()
    last[0] = forward // 2
    with pytest.raises(TimeIsUp):
        copied.predict(states, values)
    asked.clear()
    last[0] = forward + 5
    predicted = copied.predict(states, values).sum()
    with pytest.raises(TimeIsUp):
        torch.autograd.grad(predicted, values)
    asked.clear()
    net.predict(states, values)
    assert not asked


@pytest.mark.parametrize("when", [1, 50, 400, 900])
def test_a_plan_can_be_cancelled_anywhere(net, grids, when):
    """While guesses are made, starts are rated and searches run."""
    asked = []

    def should_stop():
        asked.append(1)
        return len(asked) > when

    with pytest.raises(CancelledError):
        plan(net, *grids, 2, PLANNERS["ours"], should_stop=should_stop)
    assert len(asked) == when + 1


def test_a_plan_can_be_cancelled_while_what_was_found_is_adjusted(net, grids):
    """The last time that it asks is after the search."""
    asked, iterations = [], []

    def should_stop():
        asked.append(len(iterations))
        return False

    config = replace(PLANNERS["ours"], max_iterations=3, grasp_tolerance_voxels=16)
    plan(net, *grids, 1, config, on_iteration=iterations.append, should_stop=should_stop)
    assert asked[-1] == len(iterations) == 3
    last = len(asked)
    with pytest.raises(CancelledError):
        plan(net, *grids, 1, config, should_stop=lambda: asked.append(0) or len(asked) == 2 * last)


def test_time_that_is_up_gives_the_best_so_far_or_says_that_there_is_none(net, grids, monkeypatch):
    """A clock that goes on by a second at every look."""
    now = [0.0]

    def monotonic():
        now[0] += 1.0
        return now[0]

    monkeypatch.setattr(time, "monotonic", monotonic)
    iterations = []
    for budget in (200.0, 400.0, math.inf):
        now[0] = 0.0
        config = PlannerConfig(
            restarts=4,
            candidates=16,
            guessed_share=0.5,
            max_iterations=20,
            min_improvement=-1.0,
            grasp_tolerance_voxels=16,
            time_budget=budget,
        )
        iterations.append(plan(net, *grids, 1, config).iterations)
    assert 0 < iterations[0] < iterations[1] < iterations[2] == 20
    now[0] = 0.0
    with pytest.raises(NoPlanError, match="time budget of 5 s"):
        plan(net, *grids, 1, PlannerConfig(time_budget=5.0))
