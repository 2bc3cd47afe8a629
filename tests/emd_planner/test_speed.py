"""Counting work and speed."""

from __future__ import annotations

import pytest
import torch

from emd_planner.speed import SpeedMeter, count_operations, measure_peak


def test_operations_of_products_are_counted() -> None:
    """Two for each multiplication and addition, on the way back too."""
    left, right = torch.ones(10, 20, requires_grad=True), torch.ones(20, 30)
    assert count_operations(lambda: left @ right) == 2 * 10 * 20 * 30
    assert count_operations(lambda: (left @ right).sum().backward()) == 4 * 10 * 20 * 30


def test_speed_is_that_since_it_was_last_asked_for() -> None:
    """Steps over seconds, and their operations over the device's peak."""
    device = torch.device("cpu")
    meter = SpeedMeter(device, torch.float32)
    assert not meter.knows_work
    meter.set_work(1000)
    for _ in range(4):
        meter.note(0.5)
    rate, share = meter.take()
    assert rate == pytest.approx(2.0) and 0.0 < share < 1e-3
    meter.note(0.25)
    assert meter.take()[0] == pytest.approx(4.0)
    assert 1e8 < measure_peak(device, torch.float32) < 1e15
