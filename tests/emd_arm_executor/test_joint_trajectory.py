"""Sampled joint motion."""

from __future__ import annotations

import numpy as np
import pytest

from emd_arm_executor.joint_trajectory import JointTrajectory
from emd_core.errors import InvalidInputError


def _quintic() -> JointTrajectory:
    """Two joints on polynomials of fifth degree, sampled coarsely."""
    times = np.linspace(0.0, 2.0, 5)
    powers = np.stack([times**5 - 2 * times**2, 0.5 * times**3])
    first = np.stack([5 * times**4 - 4 * times, 1.5 * times**2])
    second = np.stack([20 * times**3 - 4, 3 * times])
    return JointTrajectory(("a", "b"), times, powers.T, first.T, second.T)


def test_sampling_reproduces_a_quintic() -> None:
    """Between coarse points a polynomial of fifth degree is met exactly."""
    trajectory = _quintic()
    for time in np.linspace(0.0, 2.0, 33):
        wanted = [time**5 - 2 * time**2, 0.5 * time**3]
        assert trajectory.sample(time) == pytest.approx(wanted, abs=1e-9)


def test_ends_hold() -> None:
    """Before the start and after the end the joints stand."""
    trajectory = _quintic()
    assert trajectory.sample(-1.0) == pytest.approx(trajectory.positions[0])
    assert trajectory.sample(9.0) == pytest.approx(trajectory.positions[-1])


def test_selection_reorders() -> None:
    """Joints can be picked in any order; unknown ones are refused."""
    trajectory = _quintic()
    assert trajectory.select(("b", "a")).positions == pytest.approx(trajectory.positions[:, ::-1])
    with pytest.raises(InvalidInputError, match="elbow"):
        trajectory.select(("elbow",))


@pytest.mark.parametrize("times", [[0.0, 0.0], [0.0, -1.0], [0.0]])
def test_unusable_times_are_refused(times: list[float]) -> None:
    """Times must increase and fit the points."""
    zeros = np.zeros((2, 1))
    with pytest.raises(InvalidInputError):
        JointTrajectory(("a",), np.array(times), zeros, zeros, zeros)


def test_values_must_be_finite() -> None:
    """NaN does not reach a robot."""
    bad = np.array([[0.0], [np.nan]])
    with pytest.raises(InvalidInputError):
        JointTrajectory(("a",), np.array([0.0, 1.0]), bad, bad, bad)
