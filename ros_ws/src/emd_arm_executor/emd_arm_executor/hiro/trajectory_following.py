"""Joint trajectories, interpolated as by ros2_control's joint_trajectory_controller."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from emd_arm_executor.hiro.description import JOINT_LIMITS
from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray


@dataclass(frozen=True)
class CommandedTrajectory:
    """Points that joints pass at given times.

    Between two points the path is a straight line if only positions are given, a cubic spline with
    velocities, and a quintic spline with accelerations as well.

    Attributes:
        joint_names: Names of the J joints.
        times: Times of the N points from the trajectory's start, shape (N,), seconds, increasing.
        positions: Shape (N, J), radians.
        velocities: Shape (N, J), rad/s, or None.
        accelerations: Shape (N, J), rad/s^2, or None; needs velocities.
    """

    joint_names: tuple[str, ...]
    times: FloatArray
    positions: FloatArray
    velocities: FloatArray | None = None
    accelerations: FloatArray | None = None

    def __post_init__(self) -> None:
        """Check names, shapes, times and limits.

        Raises:
            InvalidInputError: If a joint is unknown or named twice, a shape is wrong, a value is
                not finite, the times do not increase, or a position is out of limits.
        """
        object.__setattr__(self, "joint_names", tuple(self.joint_names))
        object.__setattr__(self, "times", np.asarray(self.times, dtype=np.float64))
        for name in ("positions", "velocities", "accelerations"):
            values = getattr(self, name)
            if values is not None:
                object.__setattr__(self, name, np.asarray(values, dtype=np.float64))
        _check_names(self.joint_names)
        _check_times(self.times)
        self._check_values()
        _check_limits(self.joint_names, self.positions)

    @property
    def duration(self) -> float:
        """Time of the last point, seconds."""
        return float(self.times[-1])

    def reordered(self, joint_names: Sequence[str]) -> CommandedTrajectory:
        """Give the same trajectory with its joints in another order.

        Raises:
            InvalidInputError: If the names are not the same set.
        """
        if sorted(joint_names) != sorted(self.joint_names):
            raise InvalidInputError(
                f"a trajectory of {sorted(joint_names)} is wanted, got {sorted(self.joint_names)}"
            )
        order = [self.joint_names.index(name) for name in joint_names]
        return CommandedTrajectory(
            tuple(joint_names),
            self.times,
            self.positions[:, order],
            None if self.velocities is None else self.velocities[:, order],
            None if self.accelerations is None else self.accelerations[:, order],
        )

    def _check_values(self) -> None:
        wanted = (len(self.times), len(self.joint_names))
        for name in ("positions", "velocities", "accelerations"):
            values = getattr(self, name)
            if values is None:
                continue
            if values.shape != wanted:
                raise InvalidInputError(
                    f"{name} must have shape {wanted} (points, joints), got {values.shape}"
                )
            if not np.isfinite(values).all():
                raise InvalidInputError(f"{name} must be finite, got NaN or infinity")
        if self.accelerations is not None and self.velocities is None:
            raise InvalidInputError("accelerations need velocities beside them, got none")


class TrajectoryFollower:
    """Where the joints of one group should be at any time.

    A new trajectory replaces the old one at once and begins where the old one was; after its last
    point the joints stay there.
    """

    def __init__(self, joint_names: Sequence[str], positions: FloatArray) -> None:
        """Hold positions, shape (J,), radians."""
        self.joint_names = tuple(joint_names)
        self._start_time = 0.0
        self._trajectory: CommandedTrajectory | None = None
        self._hold = np.array(positions, dtype=np.float64)

    def hold(self, positions: FloatArray) -> None:
        """Drop the trajectory and stay at positions, shape (J,), radians."""
        self._trajectory = None
        self._hold = np.array(positions, dtype=np.float64)

    def start(self, trajectory: CommandedTrajectory, time: float) -> None:
        """Follow a trajectory from `time` (seconds) on.

        If its first point lies later than its start, the joints go there from where they are.

        Raises:
            InvalidInputError: If it does not name exactly the joints of this group. The old
                trajectory goes on then.
        """
        wanted = trajectory.reordered(self.joint_names)
        if wanted.times[0] > 0:
            wanted = self._prepend_state(wanted, time)
        self._trajectory, self._start_time = wanted, time

    def is_active(self, time: float) -> bool:
        """Whether the last point still lies ahead."""
        trajectory = self._trajectory
        return trajectory is not None and time < self._start_time + trajectory.duration

    def sample(self, time: float) -> tuple[FloatArray, FloatArray]:
        """Positions and velocities wanted at a time, each of shape (J,), rad and rad/s."""
        if self._trajectory is None:
            return self._hold.copy(), np.zeros_like(self._hold)
        return interpolate(self._trajectory, time - self._start_time)

    def _prepend_state(self, trajectory: CommandedTrajectory, time: float) -> CommandedTrajectory:
        position, velocity = self.sample(time)
        velocities, accelerations = trajectory.velocities, trajectory.accelerations
        return CommandedTrajectory(
            trajectory.joint_names,
            np.concatenate([[0.0], trajectory.times]),
            np.vstack([position, trajectory.positions]),
            None if velocities is None else np.vstack([velocity, velocities]),
            None if accelerations is None else np.vstack([0 * velocity, accelerations]),
        )


def interpolate(trajectory: CommandedTrajectory, time: float) -> tuple[FloatArray, FloatArray]:
    """Positions and velocities of a trajectory at a time after its start, each of shape (J,).

    Before the first point it gives that point, after the last one that one at rest.
    """
    times = trajectory.times
    if time >= times[-1] or time <= times[0]:
        index = -1 if time >= times[-1] else 0
        return trajectory.positions[index].copy(), np.zeros(len(trajectory.joint_names))
    segment = int(np.searchsorted(times, time, side="right")) - 1
    span = float(times[segment + 1] - times[segment])
    coefficients = _segment_polynomial(trajectory, segment, span)
    powers = (time - times[segment]) / span
    exponents = np.arange(len(coefficients))
    position = (powers**exponents) @ coefficients
    velocity = (exponents[1:] * powers ** (exponents[1:] - 1)) @ coefficients[1:] / span
    return position, velocity


def _segment_polynomial(trajectory: CommandedTrajectory, segment: int, span: float) -> FloatArray:
    """Coefficients of 1, s, s^2, ... with s = 0..1 over the segment, shape (degree + 1, J)."""
    p0, p1 = trajectory.positions[segment : segment + 2]
    if trajectory.velocities is None:
        return np.stack([p0, p1 - p0])
    v0, v1 = trajectory.velocities[segment : segment + 2] * span
    step = p1 - p0
    if trajectory.accelerations is None:
        return np.stack([p0, v0, 3 * step - 2 * v0 - v1, -2 * step + v0 + v1])
    a0, a1 = trajectory.accelerations[segment : segment + 2] * span**2
    return np.stack(
        [
            p0,
            v0,
            a0 / 2,
            10 * step - 6 * v0 - 4 * v1 - 1.5 * a0 + 0.5 * a1,
            -15 * step + 8 * v0 + 7 * v1 + 1.5 * a0 - a1,
            6 * step - 3 * (v0 + v1) - 0.5 * (a0 - a1),
        ]
    )


def _check_names(joint_names: Sequence[str]) -> None:
    unknown = [name for name in joint_names if name not in JOINT_LIMITS]
    if unknown or not joint_names or len(set(joint_names)) != len(joint_names):
        raise InvalidInputError(
            f"a trajectory names joints of HIRO, each once, got {list(joint_names)}"
        )


def _check_times(times: FloatArray) -> None:
    if times.ndim != 1 or len(times) == 0 or not np.isfinite(times).all():
        raise InvalidInputError(f"times must be at least one finite number, got {times}")
    if times[0] < 0 or (np.diff(times) <= 0).any():
        raise InvalidInputError(f"times must not be negative and must increase, got {times}")


def _check_limits(joint_names: Sequence[str], positions: FloatArray) -> None:
    for index, name in enumerate(joint_names):
        limits = JOINT_LIMITS[name]
        low, high = positions[:, index].min(), positions[:, index].max()
        if low < limits.lower - 1e-6 or high > limits.upper + 1e-6:
            raise InvalidInputError(
                f"{name} moves from {limits.lower:.4f} to {limits.upper:.4f} rad, the trajectory "
                f"wants {low:.4f} to {high:.4f}"
            )
