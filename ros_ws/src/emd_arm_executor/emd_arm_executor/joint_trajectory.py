"""Joint positions over time, the form in which a motion leaves the planner."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray


@dataclass(frozen=True)
class JointTrajectory:
    """Sampled motion of some joints; times count from its start.

    Attributes:
        joint_names: The n joints.
        times: Increasing from 0, shape (T,), seconds.
        positions: Shape (T, n), radians.
        velocities: Shape (T, n), rad/s.
        accelerations: Shape (T, n), rad/s^2.
    """

    joint_names: tuple[str, ...]
    times: FloatArray
    positions: FloatArray
    velocities: FloatArray
    accelerations: FloatArray

    def __post_init__(self) -> None:
        """Check shapes and values.

        Raises:
            InvalidInputError: If shapes do not fit, times do not increase or a value is not
                finite.
        """
        shape = (len(self.times), len(self.joint_names))
        arrays = (self.positions, self.velocities, self.accelerations)
        if any(array.shape != shape for array in arrays) or len(self.times) == 0:
            raise InvalidInputError(
                f"a trajectory needs arrays of {shape} (times, joints), got "
                f"{[array.shape for array in arrays]}"
            )
        if not (np.diff(self.times) > 0.0).all():
            raise InvalidInputError("the times of a trajectory must increase")
        if not all(np.isfinite(array).all() for array in arrays):
            raise InvalidInputError("a trajectory must be finite, got NaN or infinity")

    @property
    def duration(self) -> float:
        """Time of the last point, seconds."""
        return float(self.times[-1])

    def select(self, joint_names: Sequence[str]) -> JointTrajectory:
        """Give the trajectory of some of the joints, in the order asked for.

        Raises:
            InvalidInputError: If a joint is not in the trajectory.
        """
        missing = [name for name in joint_names if name not in self.joint_names]
        if missing:
            raise InvalidInputError(f"the trajectory moves {self.joint_names}, not {missing}")
        columns = [self.joint_names.index(name) for name in joint_names]
        return JointTrajectory(
            tuple(joint_names),
            self.times,
            self.positions[:, columns],
            self.velocities[:, columns],
            self.accelerations[:, columns],
        )

    def sample(self, time: float) -> FloatArray:
        """Interpolate joint positions (n,) at a time; the ends hold before and after.

        Quintic Hermite polynomials, which meet position, velocity and acceleration at the points.
        """
        if time <= self.times[0] or len(self.times) == 1:
            return self.positions[0].copy()
        if time >= self.times[-1]:
            return self.positions[-1].copy()
        i = int(np.searchsorted(self.times, time, side="right")) - 1
        h = self.times[i + 1] - self.times[i]
        u = (time - self.times[i]) / h
        p0, p1 = self.positions[i : i + 2]
        v0, v1 = self.velocities[i : i + 2] * h
        a0, a1 = self.accelerations[i : i + 2] * h * h
        gap = p1 - p0
        c3 = 10.0 * gap - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1
        c4 = -15.0 * gap + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1
        c5 = 6.0 * gap - 3.0 * (v0 + v1) - 0.5 * (a0 - a1)
        return np.asarray(p0 + u * (v0 + u * (0.5 * a0 + u * (c3 + u * (c4 + u * c5)))))
