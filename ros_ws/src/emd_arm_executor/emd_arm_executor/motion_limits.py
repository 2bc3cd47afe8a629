"""How fast, how hard and how suddenly joints may move."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from emd_arm_executor.config import TimingConfig
from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray


@dataclass(frozen=True)
class MotionLimits:
    """Limits of n joints.

    Attributes:
        velocity: Shape (n,), rad/s.
        acceleration: Shape (n,), rad/s^2.
        jerk: Shape (n,), rad/s^3.
    """

    velocity: FloatArray
    acceleration: FloatArray
    jerk: FloatArray

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            InvalidInputError: If a limit is not positive or the shapes differ.
        """
        arrays = [np.asarray(a) for a in (self.velocity, self.acceleration, self.jerk)]
        if len({a.shape for a in arrays}) != 1 or not all((a > 0.0).all() for a in arrays):
            raise InvalidInputError(
                "joint limits must be positive and of equal shape, got "
                f"{[a.tolist() for a in arrays]}"
            )

    @classmethod
    def of(cls, max_velocity: FloatArray, config: TimingConfig | None = None) -> MotionLimits:
        """Scale the joints' published speeds (n,) and add the configured other limits."""
        config = config or TimingConfig()
        velocity = np.minimum(config.speed_factor * max_velocity, config.max_velocity)
        ones = np.ones_like(velocity)
        return cls(velocity, config.max_acceleration * ones, config.max_jerk * ones)

    @classmethod
    def for_stop(
        cls, max_velocity: FloatArray, config: TimingConfig | None = None
    ) -> MotionLimits:
        """Give the higher limits of joints with these published speeds (n,) while they stop."""
        config = config or TimingConfig()
        moving = cls.of(max_velocity, config)
        ones = np.ones_like(max_velocity)
        return replace(
            moving,
            acceleration=config.stop_acceleration * ones,
            jerk=config.stop_jerk * ones,
        )

    def excess(
        self, velocities: FloatArray, accelerations: FloatArray, jerks: FloatArray
    ) -> tuple[float, float, float]:
        """Give the largest ratios of motions (T, n) to the limits; above 1 is too much."""
        pairs = (
            (velocities, self.velocity),
            (accelerations, self.acceleration),
            (jerks, self.jerk),
        )
        v, a, j = (float((np.abs(motion) / limit).max()) for motion, limit in pairs)
        return v, a, j
