"""A curve in joint space over a path parameter: where the joints go, not yet when."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray

# A turn of a hand counts on the path parameter like this much travel, metres per radian.
_METRES_PER_RADIAN = 0.1
# Places at which a path is first looked at, for each knot. Between these a joint's speed seldom
# varies by more than this factor.
_PER_KNOT = 4
_UNEVEN = 1.1


@dataclass(frozen=True)
class JointPath:
    """A twice continuously differentiable curve of joint positions.

    Attributes:
        joint_names: The n joints, of one or both arms.
        length: Greatest value of the path parameter, which starts at 0: metres of the hand that
            travels farthest, or radians of the joint that turns farthest.
        spline: Cubic spline from the parameter to joint positions (n,), radians.
    """

    joint_names: tuple[str, ...]
    length: float
    spline: CubicSpline

    @classmethod
    def through(
        cls, joint_names: Sequence[str], positions: FloatArray, parameters: FloatArray
    ) -> JointPath:
        """Lay a spline through joint positions (N, n) at increasing parameters (N,).

        Raises:
            InvalidInputError: If fewer than two points are given, shapes do not fit or the
                parameters do not increase.
        """
        values = np.asarray(parameters, dtype=np.float64)
        if (
            len(values) < 2
            or np.shape(positions) != (len(values), len(joint_names))
            or not (np.diff(values) > 0.0).all()
        ):
            raise InvalidInputError(
                "a joint path needs positions (N, n) for n joint names at N >= 2 increasing "
                f"parameters, got {np.shape(positions)}, {len(joint_names)} names, {len(values)} "
                "parameters"
            )
        spline = CubicSpline(values - values[0], positions)
        return cls(tuple(joint_names), float(values[-1] - values[0]), spline)

    @classmethod
    def straight(cls, joint_names: Sequence[str], start: FloatArray, end: FloatArray) -> JointPath:
        """Go straight from one posture (n,) to another; the length may be almost 0."""
        length = max(float(np.abs(np.asarray(end) - start).max()), 1e-9)
        return cls.through(joint_names, np.stack([start, end]), np.array([0.0, length]))

    @property
    def is_straight(self) -> bool:
        """Whether it leads straight from one posture to another, as a spline through two does."""
        return len(self.spline.x) == 2

    def positions(self, parameter: FloatArray | float) -> FloatArray:
        """Give joint positions at parameters (...), shape (..., n), radians."""
        return np.asarray(self.spline(parameter))

    def derivatives(self, parameter: FloatArray | float) -> tuple[FloatArray, ...]:
        """Give the first three derivatives with respect to the parameter, each (..., n)."""
        return tuple(np.asarray(self.spline(parameter, order)) for order in (1, 2, 3))

    def densely(self, joint_step: float) -> tuple[FloatArray, FloatArray]:
        """Sample so finely that no joint changes by more than `joint_step` between neighbours.

        Returns:
            Parameters (M,) and joint positions (M, n), ends included.
        """
        parameters = np.linspace(0.0, self.length, max(16, _PER_KNOT * len(self.spline.x)))
        while True:
            positions = self.positions(parameters)
            steps = np.abs(np.diff(positions, axis=0)).max(axis=1) / joint_step
            too_long = steps > 1.0 + 1e-9
            if not too_long.any():
                return parameters, positions
            counts = np.where(too_long, np.ceil(_UNEVEN * steps), 1.0)
            places = np.arange(counts.sum() + 1.0)
            parameters = np.interp(places, np.append(0.0, counts.cumsum()), parameters)


def travel_parameters(transforms: FloatArray) -> FloatArray:
    """Measure how far the hands have come at each pose: the farthest of them, turns included.

    Args:
        transforms: Poses of H hands, shape (H, N, 4, 4).

    Returns:
        Increasing parameters, shape (N,), metres.
    """
    shift = np.linalg.norm(np.diff(transforms[..., :3, 3], axis=1), axis=2)
    matrices = transforms[..., :3, :3].reshape(-1, 3, 3)
    count = transforms.shape[1]
    turns = np.zeros_like(shift)
    for h in range(len(transforms)):
        rotations = Rotation.from_matrix(matrices[h * count : (h + 1) * count])
        turns[h] = (rotations[:-1].inv() * rotations[1:]).magnitude()
    steps = np.maximum((shift + _METRES_PER_RADIAN * turns).max(axis=0), 1e-9)
    return np.append(0.0, np.cumsum(steps))
