"""HIRO at its table in a rigid-body world (PyBullet)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import TracebackType

import numpy as np
import pybullet
from numpy.typing import ArrayLike

from emd_arm_executor.hiro.contacts import FLOOR, TABLE, Contact
from emd_arm_executor.hiro.description import (
    HANDS,
    JOINT_LIMITS,
    JOINT_NAMES,
    OBSERVE,
    CellGeometry,
    GripperGeometry,
    Posture,
    joint_group,
)
from emd_arm_executor.hiro.pybullet_robot import PyBulletRobot
from emd_core.errors import InvalidInputError, SimulationError
from emd_core.frames import FloatArray


@dataclass(frozen=True)
class WorldConfig:
    """Constants of the rigid-body simulation.

    Attributes:
        time_step: Length of one step, seconds.
        gravity: Acceleration along z, m/s^2.
        position_gain: Share of a joint's position error that its servo removes in one step, 0..1.
        velocity_gain: Share of a joint's velocity error that its servo removes in one step, 0..1.
    """

    time_step: float = 1.0 / 240.0
    gravity: float = -9.81
    position_gain: float = 0.3
    velocity_gain: float = 1.0

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            InvalidInputError: If the time step is not in (0, 0.01] or a gain not in (0, 1].
        """
        if not 0 < self.time_step <= 0.01:
            raise InvalidInputError(f"time_step must be in (0, 0.01] s, got {self.time_step}")
        if not (0 < self.position_gain <= 1 and 0 < self.velocity_gain <= 1):
            raise InvalidInputError(f"gains must be in (0, 1], got {self}")


class HiroWorld:
    """Robot with a fixed base, table and floor; servos hold what they are told.

    A servo's set-point moves towards the target no faster than the joint's speed limit, and never
    leaves the position limits. Each instance has its own PyBullet client. Arrays over joints have
    the order of `JOINT_NAMES`.
    """

    def __init__(
        self,
        config: WorldConfig | None = None,
        geometry: CellGeometry | None = None,
        posture: Posture = OBSERVE,
        gui: bool = False,
    ) -> None:
        """Build the world with the robot at rest in a posture.

        Args:
            config: Constants of the simulation.
            geometry: Where table and floor are.
            posture: Where the robot begins.
            gui: Whether to open PyBullet's window.
        """
        self.config = config or WorldConfig()
        self.geometry = geometry or CellGeometry()
        self.gripper = GripperGeometry()
        self._client: int = pybullet.connect(pybullet.GUI if gui else pybullet.DIRECT)
        if self._client < 0:
            raise SimulationError("PyBullet gave no client; is a display there for its window?")
        pybullet.setGravity(0, 0, self.config.gravity, physicsClientId=self._client)
        pybullet.setTimeStep(self.config.time_step, physicsClientId=self._client)
        self._robot = PyBulletRobot(self._client)
        self._bodies = {self._add_table(): TABLE, self._add_floor(): FLOOR}
        self._lower = np.array([JOINT_LIMITS[name].lower for name in JOINT_NAMES])
        self._upper = np.array([JOINT_LIMITS[name].upper for name in JOINT_NAMES])
        self._speed = np.array([JOINT_LIMITS[name].speed for name in JOINT_NAMES])
        self._target = np.zeros(len(JOINT_NAMES))
        self._setpoint = np.zeros(len(JOINT_NAMES))
        self.reset(posture)

    def close(self) -> None:
        """Leave PyBullet; a second call does nothing."""
        if self._client >= 0:
            pybullet.disconnect(physicsClientId=self._client)
            self._client = -1

    def __enter__(self) -> HiroWorld:
        """Use the world in a `with` statement."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Leave PyBullet."""
        self.close()

    @property
    def links(self) -> tuple[str, ...]:
        """Names of all links, WAIST first."""
        return self._robot.links

    def reset(self, posture: Posture = OBSERVE) -> None:
        """Put the robot at rest in a posture, without moving there."""
        angles = posture.by_joint()
        self._target[:] = [angles[name] for name in JOINT_NAMES]
        self._setpoint[:] = self._target
        self._robot.reset(self._target)

    def set_joint_targets(self, targets: Mapping[str, float]) -> None:
        """Tell joints where to go; joints not named keep their targets.

        Args:
            targets: Positions by joint name, radians.

        Raises:
            InvalidInputError: If a joint is unknown, or a position not finite or out of limits. No
                target has changed then.
        """
        wanted = self._target.copy()
        for name, position in targets.items():
            if name not in JOINT_LIMITS:
                raise InvalidInputError(f"a joint of HIRO is wanted, got {name!r}")
            wanted[JOINT_NAMES.index(name)] = position
        self.set_all_joint_targets(wanted)

    def set_all_joint_targets(self, targets: ArrayLike) -> None:
        """Tell all joints where to go, shape (23,), radians.

        Raises:
            InvalidInputError: If the shape is wrong, or a position not finite or out of limits.
        """
        wanted = np.asarray(targets, dtype=np.float64)
        if wanted.shape != self._target.shape or not np.isfinite(wanted).all():
            raise InvalidInputError(
                f"targets must be {len(JOINT_NAMES)} finite angles, got {wanted}"
            )
        outside = (wanted < self._lower - 1e-6) | (wanted > self._upper + 1e-6)
        if outside.any():
            joint = int(np.argmax(outside))
            raise InvalidInputError(
                f"{JOINT_NAMES[joint]} moves from {self._lower[joint]:.4f} to "
                f"{self._upper[joint]:.4f} rad, got {wanted[joint]:.4f}"
            )
        self._target = np.clip(wanted, self._lower, self._upper)

    def step(self) -> None:
        """Simulate one time step."""
        largest = self._speed * self.config.time_step
        change = np.clip(self._target - self._setpoint, -largest, largest)
        self._setpoint += change
        # The position gain already closes its share of the change within this step, so that only
        # the rest is fed forward; the full velocity would make the joints run ahead by a step.
        feed_forward = (1 - self.config.position_gain) * change / self.config.time_step
        self._robot.drive(
            self._setpoint, feed_forward, self.config.position_gain, self.config.velocity_gain
        )
        pybullet.stepSimulation(physicsClientId=self._client)

    @property
    def joint_states(self) -> FloatArray:
        """Positions and velocities measured now, and the servos' torques in the last step.

        Shape (3, 23): radians, rad/s, Nm. PyBullet is asked each time.
        """
        return self._robot.joint_states()

    @property
    def joint_positions(self) -> FloatArray:
        """Measured positions, shape (23,), radians."""
        return self.joint_states[0]

    @property
    def joint_velocities(self) -> FloatArray:
        """Measured velocities, shape (23,), rad/s."""
        return self.joint_states[1]

    @property
    def joint_efforts(self) -> FloatArray:
        """Torques of the servos in the last step, shape (23,), Nm."""
        return self.joint_states[2]

    @property
    def joint_setpoints(self) -> FloatArray:
        """Where the servos are told to be now, shape (23,), radians."""
        return self._setpoint.copy()

    def group_positions(self, group: str) -> FloatArray:
        """Measured positions of one joint group, radians."""
        joints = joint_group(group).joints
        first = JOINT_NAMES.index(joints[0])
        return self._robot.joint_states(slice(first, first + len(joints)))[0]

    def gripper_width(self, hand: int) -> float:
        """Measured distance between the pads of a hand (0 left, 1 right), metres."""
        return self.gripper.width_from_joints(self.group_positions(f"{HANDS[hand]}_gripper"))

    def transform_link_to_waist(self, link: str) -> FloatArray:
        """Map points of a link's frame into WAIST, 4 x 4."""
        return self._robot.link_transform(link)

    def tool_transform_in_table(self, hand: int) -> FloatArray:
        """Map points of a hand's tool frame (0 left, 1 right) into the table frame, 4 x 4."""
        in_waist = self.transform_link_to_waist(f"{HANDS[hand]}_tool")
        return self.geometry.transform_waist_to_table @ in_waist

    def link_transforms_in_waist(self) -> FloatArray:
        """Frames of all links in the order of `links`, shape (L, 4, 4)."""
        return self._robot.link_transforms()

    def contacts(self) -> list[Contact]:
        """Find what touches: robot and table, robot and floor, arm and arm, arm and body."""
        return self._robot.contacts(self._bodies)

    def ray_distance(self, start_in_waist: ArrayLike, end_in_waist: ArrayLike) -> float:
        """Distance from start to the first thing that a ray hits, metres; infinite if nothing."""
        start, end = np.asarray(start_in_waist), np.asarray(end_in_waist)
        hit = pybullet.rayTest(start, end, physicsClientId=self._client)[0]
        return float("inf") if hit[0] < 0 else float(hit[2] * np.linalg.norm(end - start))

    def _add_table(self) -> int:
        half = np.array(self.geometry.table_size) / 2
        return self._add_static(pybullet.GEOM_BOX, self.geometry.table_centre_in_waist, half)

    def _add_floor(self) -> int:
        half = np.array([2.0, 2.0, 0.01])
        return self._add_static(
            pybullet.GEOM_BOX, np.array([0, 0, self.geometry.floor_height - half[2]]), half
        )

    def _add_static(self, kind: int, centre: FloatArray, half: FloatArray) -> int:
        shape = pybullet.createCollisionShape(kind, halfExtents=half, physicsClientId=self._client)
        body: int = pybullet.createMultiBody(
            0, shape, basePosition=centre, physicsClientId=self._client
        )
        return body
