"""HIRO as a body of a PyBullet client: links, joints and servos by name."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pybullet
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from emd_arm_executor.hiro.contacts import Contact, watched_pairs
from emd_arm_executor.hiro.description import JOINT_LIMITS, JOINT_NAMES, URDF_PATH
from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray, transform_from_pose


class PyBulletRobot:
    """The robot with a fixed base at the world's origin; arrays have the order of `JOINT_NAMES`.

    Arms collide with each other, with the body and with other bodies, but an arm's links not with
    their own neighbours, whose simplified shapes overlap.
    """

    def __init__(self, client: int) -> None:
        """Load the URDF into a PyBullet client."""
        self._client = client
        self.body: int = pybullet.loadURDF(
            str(URDF_PATH),
            useFixedBase=True,
            flags=pybullet.URDF_USE_INERTIA_FROM_FILE
            | pybullet.URDF_USE_SELF_COLLISION
            | pybullet.URDF_USE_IMPLICIT_CYLINDER,
            physicsClientId=client,
        )
        # PyBullet numbers links from -1, the base.
        self._link_index = {"WAIST": -1}
        joint_index = {}
        for index in range(pybullet.getNumJoints(self.body, physicsClientId=client)):
            info = pybullet.getJointInfo(self.body, index, physicsClientId=client)
            joint_index[info[1].decode()] = index
            self._link_index[info[12].decode()] = index
        self.links = tuple(self._link_index)
        self._joint_index = [joint_index[name] for name in JOINT_NAMES]
        self._effort = np.array([JOINT_LIMITS[name].effort for name in JOINT_NAMES])
        self._filter_collisions()

    def reset(self, positions: Iterable[float]) -> None:
        """Put the joints at positions (23,), radians, at rest."""
        for index, position in zip(self._joint_index, positions, strict=True):
            pybullet.resetJointState(self.body, index, position, physicsClientId=self._client)

    def drive(
        self,
        positions: FloatArray,
        velocities: FloatArray,
        position_gain: float,
        velocity_gain: float,
    ) -> None:
        """Set the servos' goals for the next step, rad and rad/s, with gains 0..1 a step."""
        count = len(self._joint_index)
        pybullet.setJointMotorControlArray(
            self.body,
            self._joint_index,
            pybullet.POSITION_CONTROL,
            targetPositions=positions,
            targetVelocities=velocities,
            forces=self._effort,
            positionGains=[position_gain] * count,
            velocityGains=[velocity_gain] * count,
            physicsClientId=self._client,
        )

    def joint_states(self, joints: slice = slice(None)) -> NDArray[np.float64]:
        """Positions, velocities and servo torques, shape (3, J): rad, rad/s, Nm.

        Args:
            joints: Which J of `JOINT_NAMES`.
        """
        states = pybullet.getJointStates(
            self.body, self._joint_index[joints], physicsClientId=self._client
        )
        return np.array([(state[0], state[1], state[3]) for state in states]).T

    def link_transform(self, link: str) -> FloatArray:
        """Map points of a link's frame into WAIST, 4 x 4.

        Raises:
            InvalidInputError: If there is no such link.
        """
        if link not in self._link_index:
            raise InvalidInputError(f"a link of {sorted(self.links)} is wanted, got {link!r}")
        if link == "WAIST":
            return np.eye(4)
        state = pybullet.getLinkState(
            self.body,
            self._link_index[link],
            computeForwardKinematics=True,
            physicsClientId=self._client,
        )
        return transform_from_pose(state[4], state[5])

    def link_transforms(self) -> FloatArray:
        """Frames of all links in WAIST, in the order of `links`, shape (L, 4, 4)."""
        states = pybullet.getLinkStates(
            self.body,
            range(len(self.links) - 1),
            computeForwardKinematics=True,
            physicsClientId=self._client,
        )
        transforms = np.tile(np.eye(4), (len(self.links), 1, 1))
        quaternions = np.array([state[5] for state in states])
        transforms[1:, :3, :3] = Rotation.from_quat(quaternions).as_matrix()
        transforms[1:, :3, 3] = [state[4] for state in states]
        return transforms

    def contacts(self, bodies: dict[int, str]) -> list[Contact]:
        """Find what touches the robot now; `bodies` names the other bodies."""
        pybullet.performCollisionDetection(physicsClientId=self._client)
        found = []
        for point in pybullet.getContactPoints(self.body, physicsClientId=self._client):
            depth = -point[8]
            if depth < 0:
                continue
            (body_a, link_a), (body_b, link_b) = (point[1], point[3]), (point[2], point[4])
            if body_a != self.body:
                body_b, link_a, link_b = body_a, link_b, link_a
            other = bodies.get(body_b) or self.links[link_b + 1]
            found.append(Contact(self.links[link_a + 1], other, depth, tuple(point[5])))
        return found

    def _filter_collisions(self) -> None:
        watched = set(watched_pairs(self.links))
        for link_a, index_a in self._link_index.items():
            for link_b, index_b in self._link_index.items():
                if index_a < index_b:
                    pybullet.setCollisionFilterPair(
                        self.body,
                        self.body,
                        index_a,
                        index_b,
                        (link_a, link_b) in watched,
                        physicsClientId=self._client,
                    )
