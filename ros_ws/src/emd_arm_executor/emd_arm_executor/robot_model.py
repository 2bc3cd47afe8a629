"""A robot ready to be planned for: its arms, its whole configuration, its collisions."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin

from emd_arm_executor.arm_group import configuration
from emd_arm_executor.collision import CollisionChecker
from emd_arm_executor.config import MotionConfig
from emd_arm_executor.kinematics import ArmKinematics
from emd_arm_executor.robot_description import RobotDescription
from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray


class RobotModel:
    """Kinematics and collision checks of a described robot."""

    arms: Mapping[str, ArmKinematics]

    def __init__(self, description: RobotDescription, config: MotionConfig | None = None) -> None:
        """Read the URDF and build the arms and the collision checker.

        Raises:
            InvalidInputError: If the URDF cannot be read or lacks a joint or frame.
        """
        self.description = description
        self.config = config or MotionConfig()
        try:
            self._model = pin.buildModelFromUrdf(str(description.urdf))
        except (ValueError, RuntimeError) as err:
            raise InvalidInputError(f"{description.urdf} should be a URDF: {err}") from err
        rest = dict(description.rest)
        self._rest = configuration(self._model, rest)
        self._column = {
            str(name): self._model.joints[self._model.getJointId(str(name))].idx_q
            for name in self._model.names[1:]
        }
        self.arms = self._make_arms()
        self.collision = CollisionChecker(
            self._model, description, self._rest, self.config.collision
        )
        self._speeds = {
            str(name): float(self._model.upperVelocityLimit[self._model.joints[i].idx_v])
            for i, name in enumerate(self._model.names)
            if i > 0
        }
        self._turned: dict[float, RobotModel] = {}

    def _make_arms(self) -> Mapping[str, ArmKinematics]:
        return {
            name: ArmKinematics(self._model, arm.group, self._rest, self.config.kinematics)
            for name, arm in self.description.arms.items()
        }

    @property
    def torso_position(self) -> float:
        """Where the torso is locked, radians; 0 for a robot without one."""
        torso = self.description.torso
        return 0.0 if torso is None else float(self._rest[self._column[torso.joint_name]])

    def at_torso(self, position: float) -> RobotModel:
        """Give the same robot with its torso locked elsewhere, radians.

        Both arms then stand on the turned torso, so their poses stay consistent.

        Raises:
            InvalidInputError: If the robot has no torso.
        """
        torso = self.description.torso
        if position == self.torso_position:
            return self
        if torso is None:
            raise InvalidInputError("this robot has no torso that could turn its arms")
        if position not in self._turned:
            other = copy.copy(self)
            other._rest = self._rest.copy()
            other._rest[self._column[torso.joint_name]] = position
            other.arms = other._make_arms()
            self._turned[position] = other
        return self._turned[position]

    @property
    def transform_table_to_base(self) -> FloatArray:
        """The table frame in the base frame, shape (4, 4)."""
        return self.description.transform_table_to_base

    def joint_names(self, arms: Sequence[str]) -> tuple[str, ...]:
        """Give the joints of some arms, one arm after the other."""
        return tuple(j for arm in arms for j in self.description.arms[arm].group.joint_names)

    def max_velocity(self, joint_names: Sequence[str]) -> FloatArray:
        """Give the published speeds of joints, rad/s."""
        return np.array([self._speeds[name] for name in joint_names])

    def position_limits(self, joint_names: Sequence[str]) -> tuple[FloatArray, FloatArray]:
        """Give the lower and upper limits of joints that planning keeps, radians."""
        limits = {
            name: pair
            for arm in self.arms.values()
            for name, pair in zip(arm.group.joint_names, arm.chain.limits.T, strict=True)
        }
        model = self._model
        rows = [
            limits[name]
            if name in limits
            else (
                model.lowerPositionLimit[self._column[name]],
                model.upperPositionLimit[self._column[name]],
            )
            for name in joint_names
        ]
        lower, upper = np.array(rows).T
        return lower, upper

    def arm_positions(self, arms: Sequence[str], positions: Mapping[str, float]) -> FloatArray:
        """Pick the joints of some arms out of named positions, one arm after the other.

        Raises:
            InvalidInputError: If a joint is missing or not finite.
        """
        names = self.joint_names(arms)
        missing = [n for n in names if not np.isfinite(positions.get(n, np.nan))]
        if missing:
            raise InvalidInputError(
                f"the positions of all arm joints are wanted, {missing} are missing or not finite"
            )
        return np.array([positions[name] for name in names])

    def rest_positions(self, arms: Sequence[str]) -> FloatArray:
        """Give the joints of some arms at rest, one arm after the other."""
        return self.arm_positions(arms, self.description.rest)

    def configurations(
        self,
        base: Mapping[str, float],
        joint_names: Sequence[str],
        positions: FloatArray,
        widths: Mapping[str, float],
    ) -> FloatArray:
        """Lay a path of some joints over a posture of the whole robot.

        Args:
            base: Positions of joints that do not move; joints that are not named rest.
            joint_names: The moving joints.
            positions: Their positions, shape (N, n), radians.
            widths: Opening of each arm's jaws, metres.

        Returns:
            Shape (N, nq).
        """
        q = self._rest.copy()
        for name, value in base.items():
            if name in self._column:
                q[self._column[name]] = value
        for arm, width in widths.items():
            fingers = self.description.gripper.joints_from_width(width)
            for name, value in zip(
                self.description.arms[arm].gripper_joint_names, fingers, strict=True
            ):
                q[self._column[name]] = value
        rows = np.repeat(q[None], len(positions), axis=0)
        rows[:, [self._column[name] for name in joint_names]] = positions
        return rows
