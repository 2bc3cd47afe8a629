"""Motion of one parameter in pieces of constant jerk."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ruckig import InputParameter, Ruckig, Trajectory

from emd_arm_executor.path_profile import PathProfile, PathState
from emd_core.errors import InvalidInputError

LIMIT = st.floats(0.05, 20.0)


@settings(max_examples=60, deadline=None)
@given(length=st.floats(1e-3, 10.0), speed=LIMIT, acceleration=LIMIT, jerk=LIMIT)
def test_profile_agrees_with_ruckig(
    length: float, speed: float, acceleration: float, jerk: float
) -> None:
    """Unrolled into pieces, the motion is Ruckig's at every instant."""
    request = InputParameter(1)
    request.current_position, request.target_position = [0.0], [length]
    request.max_velocity, request.max_acceleration = [speed], [acceleration]
    request.max_jerk = [jerk]
    trajectory = Trajectory(1)
    Ruckig(1).calculate(request, trajectory)
    profile = PathProfile.rest_to_rest(length, speed, acceleration, jerk)
    assert profile.duration == pytest.approx(trajectory.duration)
    times = np.linspace(0.0, profile.duration, 41)
    sampled = np.stack(profile.sample(times)[:3], axis=1)
    wanted = [[row[0] for row in trajectory.at_time(time)] for time in times]
    assert sampled == pytest.approx(np.array(wanted), abs=1e-6 * max(1.0, length, speed))


@settings(max_examples=60, deadline=None)
@given(velocity=st.floats(-2.0, 2.0), acceleration=st.floats(-3.0, 3.0), limit=LIMIT, jerk=LIMIT)
def test_stopping_ends_at_rest(
    velocity: float, acceleration: float, limit: float, jerk: float
) -> None:
    """From any state the motion begins there and ends without speed and acceleration."""
    start = PathState(0.3, velocity, acceleration)
    profile = PathProfile.to_rest(start, limit, jerk)
    first = [row[0] for row in profile.sample(np.zeros(1))]
    assert first[:3] == pytest.approx([0.3, velocity, acceleration], abs=1e-9)
    last = [row[0] for row in profile.sample(np.array([profile.duration]))]
    assert last[1:3] == pytest.approx([0.0, 0.0], abs=1e-6)


def test_derivatives_are_consistent() -> None:
    """Velocity, acceleration and jerk are the derivatives of what stands before them."""
    profile = PathProfile.rest_to_rest(1.0, 0.8, 2.0, 9.0)
    times = np.linspace(0.0, profile.duration, 4001)
    position, velocity, acceleration, jerk = profile.sample(times)
    assert np.gradient(position, times)[1:-1] == pytest.approx(velocity[1:-1], abs=1e-4)
    assert np.gradient(velocity, times)[1:-1] == pytest.approx(acceleration[1:-1], abs=5e-3)
    assert np.abs(jerk).max() == pytest.approx(9.0)


def test_rest_stays_at_rest() -> None:
    """Stopping what stands takes no time."""
    profile = PathProfile.to_rest(PathState(0.7, 0.0, 0.0), 1.0, 1.0)
    assert profile.duration == 0.0
    assert profile.sample(np.array([0.0, 5.0]))[0] == pytest.approx([0.7, 0.7])


def test_impossible_limits_are_refused() -> None:
    """A limit of zero has no motion, and the message says so."""
    with pytest.raises(InvalidInputError, match="limits"):
        PathProfile.rest_to_rest(1.0, 0.0, 1.0, 1.0)


def test_a_slowed_motion_is_the_same_curve_later() -> None:
    """Twice as long, it passes the same positions at half the speed, an eighth of the jerk."""
    profile = PathProfile.rest_to_rest(0.4, 0.3, 1.0, 10.0)
    slowed = profile.slowed(2.0)
    times = np.linspace(0.0, profile.duration, 50)[1:-1]
    before, after = profile.sample(times), slowed.sample(2.0 * times)
    for order, (fast, slow) in enumerate(zip(before, after, strict=True)):
        assert slow == pytest.approx(fast / 2.0**order, abs=1e-9)
