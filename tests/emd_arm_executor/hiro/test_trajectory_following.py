"""Interpolation of commanded trajectories."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import BPoly, CubicHermiteSpline

from emd_arm_executor.hiro.description import JOINT_GROUPS
from emd_arm_executor.hiro.trajectory_following import (
    CommandedTrajectory,
    TrajectoryFollower,
    interpolate,
)
from emd_core.errors import InvalidInputError

HEAD = JOINT_GROUPS["head"].joints
TIMES = np.array([0.0, 0.4, 1.0])
POSITIONS = np.array([[0.0, 0.1], [0.5, 0.3], [-0.2, 0.6]])
VELOCITIES = np.array([[0.0, 0.2], [0.3, -0.1], [0.0, 0.0]])
ACCELERATIONS = np.array([[1.0, 0.0], [-0.5, 0.4], [0.0, 0.2]])


def test_positions_alone_are_joined_by_straight_lines() -> None:
    """Half-way in time is half-way in angle."""
    trajectory = CommandedTrajectory(HEAD, TIMES, POSITIONS)
    position, velocity = interpolate(trajectory, 0.2)
    assert position == pytest.approx((POSITIONS[0] + POSITIONS[1]) / 2)
    assert velocity == pytest.approx((POSITIONS[1] - POSITIONS[0]) / 0.4)


@pytest.mark.parametrize("time", np.linspace(0.01, 0.99, 9))
def test_velocities_make_a_cubic_spline(time: float) -> None:
    """With velocities the path is SciPy's cubic Hermite spline."""
    spline = CubicHermiteSpline(TIMES, POSITIONS, VELOCITIES)
    position, velocity = interpolate(CommandedTrajectory(HEAD, TIMES, POSITIONS, VELOCITIES), time)
    assert position == pytest.approx(spline(time))
    assert velocity == pytest.approx(spline(time, 1))


@pytest.mark.parametrize("time", np.linspace(0.01, 0.99, 9))
def test_accelerations_make_a_quintic_spline(time: float) -> None:
    """With accelerations too the path is SciPy's quintic Hermite polynomial."""
    values = np.stack([POSITIONS, VELOCITIES, ACCELERATIONS], axis=1)
    spline = BPoly.from_derivatives(TIMES, values)
    trajectory = CommandedTrajectory(HEAD, TIMES, POSITIONS, VELOCITIES, ACCELERATIONS)
    position, velocity = interpolate(trajectory, time)
    assert position == pytest.approx(spline(time))
    assert velocity == pytest.approx(spline.derivative()(time))


def test_ends_hold_at_rest() -> None:
    """Before the first and after the last point the joints stand still there."""
    trajectory = CommandedTrajectory(HEAD, TIMES + 0.5, POSITIONS, VELOCITIES)
    for time, index in ((0.1, 0), (9.0, -1)):
        position, velocity = interpolate(trajectory, time)
        assert position == pytest.approx(POSITIONS[index])
        assert (velocity == 0).all()


def test_new_trajectory_begins_where_the_old_one_was() -> None:
    """Replacing a trajectory half-way jumps neither in position nor in velocity."""
    follower = TrajectoryFollower(HEAD, np.zeros(2))
    follower.start(CommandedTrajectory(HEAD, [1.0], [[0.6, 0.2]], [[0.0, 0.0]]), time=10.0)
    before = follower.sample(10.5)
    follower.start(CommandedTrajectory(HEAD, [1.0], [[-0.3, 0.0]], [[0.0, 0.0]]), time=10.5)
    after = follower.sample(10.5 + 1e-9)
    assert after[0] == pytest.approx(before[0], abs=1e-6)
    assert after[1] == pytest.approx(before[1], abs=1e-6)
    assert follower.sample(11.5)[0] == pytest.approx([-0.3, 0.0])
    assert follower.is_active(11.4)
    assert not follower.is_active(11.6)


def test_order_of_the_joints_does_not_matter() -> None:
    """A message may name the joints of a group in any order."""
    follower = TrajectoryFollower(HEAD, np.zeros(2))
    follower.start(CommandedTrajectory(HEAD[::-1], [1.0], [[0.5, -0.4]]), time=0.0)
    assert follower.sample(2.0)[0] == pytest.approx([-0.4, 0.5])


def test_foreign_joints_are_refused_and_the_old_trajectory_goes_on() -> None:
    """A trajectory of other joints, or of part of a group, raises."""
    follower = TrajectoryFollower(HEAD, np.zeros(2))
    follower.start(CommandedTrajectory(HEAD, [1.0], [[0.5, 0.5]]), time=0.0)
    for names in (("CHEST_JOINT0", "HEAD_JOINT0"), ("HEAD_JOINT0",)):
        with pytest.raises(InvalidInputError, match="is wanted"):
            follower.start(CommandedTrajectory(names, [1.0], [[0.0] * len(names)]), time=0.5)
    assert follower.sample(2.0)[0] == pytest.approx([0.5, 0.5])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((("TAIL",), [1.0], [[0.0]]), "TAIL"),
        ((("HEAD_JOINT0", "HEAD_JOINT0"), [1.0], [[0.0, 0.0]]), "once"),
        (((), [1.0], [[]]), "joints of HIRO"),
        ((HEAD, [], []), "at least one"),
        ((HEAD, [0.5, 0.5], [[0.0, 0.0]] * 2), "increase"),
        ((HEAD, [-0.5, 0.5], [[0.0, 0.0]] * 2), "negative"),
        ((HEAD, [float("inf")], [[0.0, 0.0]]), "finite"),
        ((HEAD, [1.0], [[0.0, float("nan")]]), "finite"),
        ((HEAD, [1.0], [[0.0]]), "shape"),
        ((HEAD, [1.0], [[0.0, 1.5]]), "HEAD_JOINT1 moves"),
        ((HEAD, [1.0], [[0.0, 0.0]], None, [[0.0, 0.0]]), "velocities"),
        ((HEAD, [1.0], [[0.0, 0.0]], [[0.0]]), "velocities"),
    ],
)
def test_bad_trajectories_are_refused(arguments, words: str) -> None:
    """Unknown joints, wrong times, NaN, wrong shapes and limits raise with the reason."""
    with pytest.raises(InvalidInputError, match=words):
        CommandedTrajectory(*arguments)
