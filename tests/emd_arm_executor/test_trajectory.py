"""Timing along joint paths, and stopping on them."""

from __future__ import annotations

import numpy as np
import pytest

from emd_arm_executor.config import TimingConfig
from emd_arm_executor.joint_path import JointPath, travel_parameters
from emd_arm_executor.joint_trajectory import JointTrajectory
from emd_arm_executor.motion_limits import MotionLimits
from emd_arm_executor.motion_plan import MotionPlan, PhaseName
from emd_arm_executor.robot_model import RobotModel
from emd_arm_executor.trajectory import TimedPath, stop_path, time_path
from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray, inverse_transform

NAMES = ("a", "b", "c")
LIMITS = MotionLimits(np.array([1.0, 0.8, 0.6]), np.full(3, 3.0), np.full(3, 40.0))
STOP = MotionLimits(LIMITS.velocity, np.full(3, 6.0), np.full(3, 100.0))


def _wavy() -> JointPath:
    """A path with bends of different tightness."""
    s = np.linspace(0.0, 1.0, 80)
    columns = [s, 0.3 * np.sin(6 * s), 0.2 * np.tanh(20 * (s - 0.6))]
    return JointPath.through(NAMES, np.stack(columns, axis=1), s)


def _segments(plan: MotionPlan) -> list[TimedPath]:
    return [segment for phase in plan.phases for segment in phase.segments]


def _excess(trajectory: JointTrajectory, limits: MotionLimits) -> tuple[float, float, float]:
    """Ratios to the limits, jerk by differences of the sampled accelerations."""
    jerk = np.diff(trajectory.accelerations, axis=0) / np.diff(trajectory.times)[:, None]
    return limits.excess(trajectory.velocities, trajectory.accelerations, jerk)


@pytest.mark.parametrize(
    "path", [_wavy(), JointPath.straight(NAMES, np.zeros(3), np.array([0.5, -1.0, 0.2]))]
)
def test_limits_of_every_joint_hold(path: JointPath) -> None:
    """Velocity, acceleration and jerk stay within the limits, and one of them is used up."""
    trajectory = time_path(path, LIMITS).sample(0.005)
    velocity, acceleration, jerk = _excess(trajectory, LIMITS)
    # Differences over 5 ms see a little more than the limit where the jerk jumps.
    assert velocity <= 1.01 and acceleration <= 1.01 and jerk <= 1.05
    assert max(velocity, acceleration, jerk) > 0.9


def test_samples_are_consistent() -> None:
    """Velocities and accelerations are the derivatives of the positions."""
    trajectory = time_path(_wavy(), LIMITS).sample(0.002)
    times = trajectory.times
    velocity = np.gradient(trajectory.positions, times, axis=0)
    acceleration = np.gradient(trajectory.velocities, times, axis=0)
    inner = slice(2, -2)
    assert velocity[inner] == pytest.approx(trajectory.velocities[inner], abs=2e-3)
    assert acceleration[inner] == pytest.approx(trajectory.accelerations[inner], abs=0.1)


def test_motion_goes_from_rest_to_rest_along_the_curve() -> None:
    """Ends are exact and still, and every sample lies on the path."""
    path = _wavy()
    trajectory = time_path(path, LIMITS).sample(0.01)
    assert trajectory.positions[0] == pytest.approx(path.positions(0.0), abs=1e-9)
    assert trajectory.positions[-1] == pytest.approx(path.positions(path.length), abs=1e-6)
    for rows in (trajectory.velocities, trajectory.accelerations):
        assert rows[[0, -1]] == pytest.approx(np.zeros((2, 3)), abs=1e-6)
    on_curve = path.positions(trajectory.positions[:, 0])
    assert trajectory.positions == pytest.approx(on_curve, abs=1e-5)


def test_speed_cap_holds() -> None:
    """The path parameter is passed no faster than asked for."""
    path = _wavy()
    trajectory = time_path(path, LIMITS, max_speed=0.1).sample(0.01)
    assert np.abs(trajectory.velocities[:, 0]).max() <= 0.1 * 1.01
    assert trajectory.duration > path.length / 0.1


def test_a_straight_path_is_timed_as_if_it_had_many_knots() -> None:
    """Two knots need no evening out; a hundred on the same line give the same motion."""
    start, end = np.array([0.0, -0.5, 0.2]), np.array([1.2, 0.7, 0.1])
    knots = np.linspace(0.0, 1.0, 100)
    straight = JointPath.straight(NAMES, start, end)
    dense = JointPath.through(NAMES, start + knots[:, None] * (end - start), knots)
    first, second = time_path(straight, LIMITS), time_path(dense, LIMITS)
    assert straight.is_straight and not dense.is_straight
    assert first.duration == pytest.approx(second.duration, rel=2e-3)
    times = np.linspace(0.0, first.duration, 7)
    assert first.joint_motion(times)[0] == pytest.approx(second.joint_motion(times)[0], abs=2e-3)


def test_higher_limits_are_faster() -> None:
    """Twice the limits shorten the motion."""
    double = MotionLimits(2 * LIMITS.velocity, 2 * LIMITS.acceleration, 2 * LIMITS.jerk)
    assert time_path(_wavy(), double).duration < 0.85 * time_path(_wavy(), LIMITS).duration


def test_whole_plan_keeps_its_limits(half_fold: MotionPlan, robot: RobotModel) -> None:
    """Every segment of a half fold with two hands keeps the limits of all twelve joints."""
    limits = MotionLimits.of(robot.max_velocity(robot.joint_names(["left", "right"])))
    for segment in _segments(half_fold):
        velocity, acceleration, jerk = _excess(segment.sample(0.005), limits)
        assert velocity <= 1.01 and acceleration <= 1.02 and jerk <= 1.06


def _tools(robot: RobotModel, positions: FloatArray, arm: str, part: slice) -> FloatArray:
    return np.stack([robot.arms[arm].forward(row) for row in positions[:, part]])


def test_hands_keep_their_relative_pose_while_carrying(
    half_fold: MotionPlan, robot: RobotModel
) -> None:
    """Seen from one hand the other stays within 0.2 mm and 0.02 degrees (paper, IV-B item 4)."""
    carry = next(p for p in half_fold.phases if p.name is PhaseName.CARRY)
    positions = carry.segments[0].sample(0.01).positions
    left = _tools(robot, positions, "left", slice(0, 6))
    right = _tools(robot, positions, "right", slice(6, 12))
    relative = np.stack([inverse_transform(a) @ b for a, b in zip(left, right, strict=True)])
    assert np.linalg.norm(relative[:, :3, 3] - relative[0, :3, 3], axis=1).max() < 2e-4
    assert np.abs(relative[:, :3, :3] - relative[0, :3, :3]).max() < 3e-4


def test_level_part_is_straight(half_fold: MotionPlan, robot: RobotModel) -> None:
    """While the hands go level they leave the straight line by less than 0.5 mm."""
    carry = next(p for p in half_fold.phases if p.name is PhaseName.CARRY)
    positions = carry.segments[0].sample(0.01).positions
    to_table = inverse_transform(robot.transform_table_to_base)
    points = (to_table @ _tools(robot, positions, "left", slice(0, 6)))[:, :3, 3]
    height = robot.config.path.lift_height
    level = points[points[:, 2] > height - 1e-4]
    assert len(level) > 50
    assert np.abs(level[:, 1] - points[0, 1]).max() < 5e-4
    assert np.abs(level[:, 2] - height).max() < 5e-4


@pytest.mark.parametrize("share", np.linspace(0.0, 1.0, 13))
def test_stop_comes_to_rest_soon_and_on_the_path(share: float) -> None:
    """From any moment the motion ends within 0.4 s, on the curve, from the state it was in."""
    path = _wavy()
    timed = time_path(path, LIMITS)
    time = share * timed.duration
    before = timed.state_at(time)
    stop = stop_path(timed, time, STOP)
    assert stop.duration <= 0.4
    after = stop.state_at(0.0)
    assert after.position == pytest.approx(before.position, abs=1e-9)
    assert after.velocity == pytest.approx(before.velocity, abs=1e-9)
    assert after.acceleration == pytest.approx(before.acceleration, abs=1e-9)
    trajectory = stop.sample(0.002)
    assert trajectory.velocities[-1] == pytest.approx(np.zeros(3), abs=1e-6)
    on_curve = path.positions(trajectory.positions[:, 0])
    assert trajectory.positions == pytest.approx(on_curve, abs=1e-5)


def test_stop_keeps_the_limits_for_stopping(half_fold: MotionPlan, robot: RobotModel) -> None:
    """Stopping a carrying motion anywhere keeps the higher limits meant for it."""
    limits = MotionLimits.for_stop(robot.max_velocity(robot.joint_names(["left", "right"])))
    carry = next(p for p in half_fold.phases if p.name is PhaseName.CARRY).segments[0]
    for time in np.linspace(0.05, carry.duration - 0.05, 15):
        trajectory = stop_path(carry, time, limits).sample(0.005)
        if len(trajectory.times) > 2:
            _, acceleration, jerk = _excess(trajectory, limits)
            assert acceleration <= 1.05 and jerk <= 1.1


def test_no_motion_takes_no_time() -> None:
    """A path without length is a single standing point."""
    still = time_path(JointPath.straight(NAMES, np.ones(3), np.ones(3)), LIMITS)
    trajectory = still.sample(0.01)
    assert trajectory.duration <= 0.01
    assert trajectory.positions == pytest.approx(np.ones_like(trajectory.positions))


def test_published_speeds_are_scaled_and_capped() -> None:
    """The speed factor scales, the cap limits."""
    config = TimingConfig(speed_factor=0.5, max_velocity=1.0)
    limits = MotionLimits.of(np.array([1.0, 4.0]), config)
    assert limits.velocity == pytest.approx([0.5, 1.0])


def test_travel_counts_shifts_and_turns() -> None:
    """The path parameter grows by the farthest hand's travel, and with a turn on the spot."""
    poses = np.repeat(np.eye(4)[None, None], 2, axis=0).repeat(3, axis=1)
    poses[0, 1:, 0, 3] = 0.02
    poses[1, 1:, 1, 3] = 0.05
    poses[1, 2, :2, :2] = [[0.0, -1.0], [1.0, 0.0]]
    parameters = travel_parameters(poses)
    assert parameters[:2] == pytest.approx([0.0, 0.05])
    assert parameters[2] - parameters[1] == pytest.approx(0.1 * np.pi / 2)


@pytest.mark.parametrize(
    ("positions", "parameters"),
    [
        (np.zeros((1, 3)), np.array([0.0])),
        (np.zeros((2, 2)), np.array([0.0, 1.0])),
        (np.zeros((2, 3)), np.array([0.0, 0.0])),
    ],
)
def test_unusable_paths_are_refused(positions: FloatArray, parameters: FloatArray) -> None:
    """Too few points, wrong widths and parameters that stand still are refused."""
    with pytest.raises(InvalidInputError):
        JointPath.through(NAMES, positions, parameters)


def test_limits_must_be_positive() -> None:
    """A joint that may not move cannot be timed."""
    with pytest.raises(InvalidInputError):
        MotionLimits(np.array([1.0, 0.0]), np.ones(2), np.ones(2))
