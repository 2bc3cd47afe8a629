"""Timing of a joint path under limits of velocity, acceleration and jerk, and stopping on it.

The motion along the path is one-dimensional and comes from Ruckig, so all joints of both arms
follow one parameter and never leave the path. Ruckig's own waypoints are not used: they would
call a remote service.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import maximum_filter1d

from emd_arm_executor.joint_path import JointPath
from emd_arm_executor.joint_trajectory import JointTrajectory
from emd_arm_executor.motion_limits import MotionLimits
from emd_arm_executor.path_profile import PathProfile, PathState
from emd_core.frames import FloatArray

# Instants at which a motion is checked against the joints' limits.
_CHECKS = 300
# Time between the instants of the last check, seconds, and what is kept free beyond it.
_FINE_CHECK = 1e-3
_SPARE = 1e-3
# How far to either side of a jump of the jerk it is looked at, seconds.
_ASIDE = 2e-5
# What is tried: widths of smoothing, and shares of acceleration and jerk.
_WINDOWS = (0.02, 0.035, 0.06)
_SHARES = (1.0, 0.6)
# A path on which no joint moves farther than this is no motion, radians.
_STILL = 1e-6


@dataclass(frozen=True)
class TimedPath:
    """A joint path and when each of its points is passed.

    Attributes:
        path: The curve.
        profile: Motion of the path parameter.
        offset: Time in the profile at which this motion starts, seconds.
    """

    path: JointPath
    profile: PathProfile
    offset: float = 0.0

    @property
    def duration(self) -> float:
        """Length in time, seconds."""
        return max(self.profile.duration - self.offset, 0.0)

    def state_at(self, time: float) -> PathState:
        """Give the path parameter's state at a time; the ends hold."""
        position, velocity, acceleration, _ = self.profile.sample(np.array([time + self.offset]))
        return PathState(float(position[0]), float(velocity[0]), float(acceleration[0]))

    def joint_motion(
        self, times: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Give positions, velocities, accelerations and jerks of the joints, each (T, n)."""
        s = self.profile.sample(times + self.offset)[0]
        positions = self.path.positions(np.clip(s, 0.0, self.path.length))
        return positions, *self.joint_derivatives(times)

    def joint_derivatives(self, times: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Give velocities, accelerations and jerks of the joints, each (T, n)."""
        s, v, a, j = (row[:, None] for row in self.profile.sample(times + self.offset))
        parameter = np.clip(s[:, 0], 0.0, self.path.length)
        first, second, third = self.path.derivatives(parameter)
        return (
            first * v,
            second * v**2 + first * a,
            third * v**3 + 3.0 * second * v * a + first * j,
        )

    def sample(self, period: float) -> JointTrajectory:
        """Sample positions, velocities and accelerations every `period` seconds, ends included."""
        count = max(1, int(np.ceil(self.duration / period - 1e-9)))
        times = np.append(np.arange(count) * period, self.duration)
        if self.duration <= 0.0:
            # Controllers want an end that lies in the future, even to stand still.
            times = np.array([0.0, period])
        positions, velocities, accelerations, _ = self.joint_motion(times)
        return JointTrajectory(self.path.joint_names, times, positions, velocities, accelerations)


def time_path(path: JointPath, limits: MotionLimits, max_speed: float | None = None) -> TimedPath:
    """Find a fast motion from rest to rest along a path that keeps every joint's limits.

    The path gets a new parameter on which bends are long and straight parts short, so that one
    cruising speed suits both. Slowing a motion down by a factor k divides velocities by k,
    accelerations by k^2 and jerks by k^3. So a trial takes limits of the path parameter,
    measures the joints' excess and scales it away exactly; the fastest of a few trials wins.
    A straight path is even as it is.

    Args:
        path: The curve, n joints.
        limits: Of these n joints.
        max_speed: Cap on the speed of the path parameter (m/s or rad/s), none if None.

    Returns:
        A motion on the same curve, whose path parameter is about seconds at full speed.
    """
    if np.ptp(path.positions(path.spline.x), axis=0).max() < _STILL:
        return TimedPath(path, PathProfile.standing())
    grid, slowness = _slowness(path, limits, max_speed)
    if path.is_straight:
        time = np.array([0.0, path.length * slowness.max()])
        even = JointPath.through(path.joint_names, path.positions(path.spline.x), time)
        return _within(_fastest([even], limits), limits)
    evened = (_even_out(path, grid, slowness, window) for window in _WINDOWS)
    return _within(_fastest(evened, limits), limits)


def _within(timed: TimedPath, limits: MotionLimits) -> TimedPath:
    """Slow a motion down by the little that it exceeds the limits by between coarse instants."""
    profile = timed.profile
    even = np.linspace(0.0, timed.duration, int(np.ceil(timed.duration / _FINE_CHECK)) + 2)
    # The jerk jumps between the profile's pieces, and at the spline's knots.
    knots = np.interp(timed.path.spline.x, profile.sample(even)[0], even)
    jumps = np.concatenate([profile.starts, knots])
    instants = np.concatenate([even, jumps - _ASIDE, jumps + _ASIDE])
    velocity, excess, sudden = limits.excess(*timed.joint_derivatives(instants))
    slower = max(velocity, excess ** (1 / 2), sudden ** (1 / 3)) * (1.0 + _SPARE)
    return timed if slower <= 1.0 else TimedPath(timed.path, profile.slowed(slower))


def _slowness(
    path: JointPath, limits: MotionLimits, max_speed: float | None
) -> tuple[FloatArray, FloatArray]:
    """Give the time that each place of a path needs for a step of its parameter.

    Args:
        path: The curve.
        limits: Of the joints.
        max_speed: Cap on the speed of the path parameter.

    Returns:
        Parameters (N,) at equal distances and seconds per unit of the parameter there (N,).
    """
    count = max(200, 4 * len(path.spline.x))
    grid = np.linspace(0.0, path.length, count + 1)
    first, second, third = (np.maximum(np.abs(d), 1e-9) for d in path.derivatives(grid))
    # A bend alone may use up half of the acceleration and of the jerk.
    slowness = np.maximum(
        (first / limits.velocity).max(axis=1),
        np.sqrt((2.0 * second / limits.acceleration).max(axis=1)),
    )
    slowness = np.maximum(slowness, np.cbrt((2.0 * third / limits.jerk).max(axis=1)))
    return grid, np.maximum(slowness, 1.0 / max_speed if max_speed else 0.0)


def _even_out(path: JointPath, grid: FloatArray, slowness: FloatArray, window: float) -> JointPath:
    """Replace the path parameter by the time that its speed limit needs, smoothed.

    Args:
        path: The curve.
        grid: Parameters, shape (N,).
        slowness: What is needed there, shape (N,).
        window: Half the width of the smoothing, as a share of the path's length.
    """
    count = len(grid) - 1
    reach = max(2, int(window * count))
    weights = 1.0 + np.cos(np.linspace(-np.pi, np.pi, 2 * reach + 1))
    padded = np.pad(slowness, 2 * reach, mode="edge")
    widest = maximum_filter1d(padded, 2 * reach + 1)[reach:-reach]
    smooth = np.convolve(widest, weights / weights.sum(), mode="valid")
    time = np.append(0.0, np.cumsum((smooth[1:] + smooth[:-1]) / 2.0 * np.diff(grid)))
    new = np.linspace(0.0, time[-1], count // 2 + 1)
    old = np.clip(CubicSpline(time, grid)(new), 0.0, path.length)
    return JointPath.through(path.joint_names, path.positions(old), new)


def _fastest(paths: Iterable[JointPath], limits: MotionLimits, start: float = 0.0) -> TimedPath:
    """Time evened paths of one curve, at least one, from `start` on; give the fastest motion.

    Each path is tried at full speed with some shares of acceleration and jerk, and slowed down
    until the joints' limits hold. What is no faster before it is slowed need not be measured.
    """
    best: TimedPath | None = None
    for path in paths:
        steepest = np.maximum(np.abs(path.derivatives(path.spline.x)[0]).max(axis=0), 1e-9)
        for share in _SHARES:
            acceleration = share * float((limits.acceleration / steepest).min())
            jerk = share * float((limits.jerk / steepest).min())
            profile = PathProfile.rest_to_rest(path.length, 1.0, acceleration, jerk, start)
            if best is not None and profile.duration >= best.duration:
                continue
            trial = TimedPath(path, profile)
            velocity, excess, sudden = limits.excess(*_checked_motion(trial))
            slower = max(velocity, excess ** (1 / 2), sudden ** (1 / 3))
            if slower > 1.0:
                slower *= 1.0 + 1e-3
                scaled = (1.0 / slower, acceleration / slower**2, jerk / slower**3)
                trial = TimedPath(path, PathProfile.rest_to_rest(path.length, *scaled, start))
            if best is None or trial.duration < best.duration:
                best = trial
    assert best is not None
    return best


def stop_path(timed: TimedPath, time: float, limits: MotionLimits) -> TimedPath:
    """Come to rest on the path as fast as the limits allow, from any moment of a motion.

    If the motion ends before such a stop would, the rest of the motion is returned.

    Args:
        timed: The motion that runs.
        time: When the stop begins, seconds from the start of `timed`.
        limits: Of the joints while stopping.

    Returns:
        A motion on the same path, from the state at `time` to rest.
    """
    rest = TimedPath(timed.path, timed.profile, timed.offset + min(max(time, 0.0), timed.duration))
    if time >= timed.duration:
        return rest
    state = timed.state_at(time)
    ahead = np.linspace(state.position, timed.path.length, 64)
    first = np.abs(timed.path.derivatives(ahead)[0])
    steepest = np.maximum(first.max(axis=0), 1e-9)
    acceleration = float((limits.acceleration / steepest).min())
    jerk = float((limits.jerk / steepest).min())
    stop = rest
    for _ in range(8):
        stop = TimedPath(timed.path, PathProfile.to_rest(state, acceleration, jerk))
        _, too_hard, too_sudden = limits.excess(*_checked_motion(stop))
        if max(too_hard, too_sudden) <= 1.0:
            break
        acceleration /= max(too_hard, 1.0)
        jerk /= max(too_sudden, 1.0)
    end = stop.state_at(stop.duration).position
    if end > timed.path.length or stop.duration > rest.duration:
        return rest
    return stop


def resume_path(stopped: TimedPath, limits: MotionLimits) -> TimedPath:
    """Go on along a path, from where a motion came to rest on it to its end.

    Args:
        stopped: What `stop_path` gave.
        limits: Of the joints.

    Returns:
        A motion on the same curve; it stands still if the end was reached.
    """
    path, position = stopped.path, stopped.state_at(stopped.duration).position
    if path.length - position < _STILL:
        return TimedPath(path, PathProfile.standing(path.length))
    return _within(_fastest([path], limits, position), limits)


def _checked_motion(timed: TimedPath) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Give velocities, accelerations and jerks of the joints at many instants, each (T, n)."""
    return timed.joint_derivatives(np.linspace(0.0, timed.duration, _CHECKS))
