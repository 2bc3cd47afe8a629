"""A robot behind ros2_control's topics, as the executor wants it."""

from __future__ import annotations

import time

import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMsg

from emd_arm_executor.joint_trajectory import JointTrajectory
from emd_arm_executor.robot_description import RobotDescription
from emd_arm_executor.robot_interface import JointReading, RobotInterface
from emd_core.errors import NoObservationError, TrackingError
from emd_core.ros import conversions

_STALLED = 30.0  # seconds of the wall clock without any progress of the robot's
_STALE = 0.03  # seconds of the robot's clock
_STALE_PATIENCE = 2.0  # seconds of the wall clock
_GRIPPER_TIME = 0.3  # seconds in which the jaws open or close
_HOLD_TIME = 0.1


class RosRobot(RobotInterface):
    """Sends trajectories to `<group>_controller/joint_trajectory` and reads `joint_states`.

    Times are those of the node's clock. A trajectory's start is the header's stamp, which the
    joint_trajectory_controller honours, so that both arms begin at the same moment.
    """

    def __init__(self, node: Node, description: RobotDescription) -> None:
        """Connect `node` with the robot's topics."""
        self._node = node
        self._description = description
        self._state: JointState | None = None
        groups = [*description.controllers]
        groups += [arm.gripper_controller for arm in description.arms.values()]
        self._publishers = {
            group: node.create_publisher(
                JointTrajectoryMsg, f"{group}_controller/joint_trajectory", 10
            )
            for group in groups
        }
        node.create_subscription(JointState, "joint_states", self._on_state, 10)

    def _on_state(self, message: JointState) -> None:
        self._state = message

    def now(self) -> float:
        """Give the time of the node's clock, seconds."""
        return float(self._node.get_clock().now().nanoseconds) * 1e-9

    def wait_until(self, time_to_reach: float) -> None:
        """Sleep until the node's clock has reached a time.

        Raises:
            TrackingError: If the clock stands still, as when a simulation is gone.
        """
        last, moved = self.now(), time.monotonic()
        while (now := self.now()) < time_to_reach:
            if now != last:
                last, moved = now, time.monotonic()
            elif time.monotonic() - moved > _STALLED:
                raise TrackingError(
                    f"the robot's clock has stood at {now:.2f} s for {_STALLED:.0f} s; is the "
                    "robot or the simulation still running?"
                )
            time.sleep(0.002)

    def read_joints(self) -> JointReading:
        """Give the measured positions; on a busy machine, wait for those of the present moment.

        Raises:
            NoObservationError: If none come, or none that is new.
        """
        wanted, patience = self.now() - _STALE, time.monotonic() + _STALE_PATIENCE
        while (reading := self._reading()) is None or reading.time < wanted:
            if time.monotonic() > patience:
                last = (
                    "no message has come" if reading is None else f"the last is of {reading.time}"
                )
                raise NoObservationError(
                    f"joint_states must be newer than {wanted:.2f} s, {last}; is the robot's "
                    "driver running?"
                )
            time.sleep(0.001)
        return reading

    def _reading(self) -> JointReading | None:
        state = self._state
        if state is None:
            return None
        stamp = conversions.time_from_message(state.header.stamp)
        return JointReading(stamp, dict(zip(state.name, state.position, strict=True)))

    def send_trajectory(self, group: str, trajectory: JointTrajectory, start_time: float) -> None:
        """Publish a trajectory that begins at `start_time`, seconds of the node's clock."""
        message = conversions.joint_trajectory_to_message(
            list(trajectory.joint_names),
            trajectory.times,
            trajectory.positions,
            trajectory.velocities,
            trajectory.accelerations,
        )
        message.header.stamp = conversions.time_to_message(start_time)
        self._publishers[group].publish(message)

    def send_gripper(self, arm: str, width: float) -> None:
        """Publish the jaws' joints for an opening."""
        hand = self._description.arms[arm]
        angles = self._description.gripper.joints_from_width(width).tolist()
        self._send_point(hand.gripper_controller, hand.gripper_joint_names, angles, _GRIPPER_TIME)

    def gripper_width(self, arm: str) -> float:
        """Measure the opening from the jaws' joints, metres."""
        measured = self.joint_positions()
        joints = self._description.arms[arm].gripper_joint_names
        angles = np.array([measured[name] for name in joints])
        return float(self._description.gripper.width_from_joints(angles))

    def hold(self) -> None:
        """Send every arm and the torso to where it is."""
        measured = self.joint_positions()
        for group, joints in self._description.controllers.items():
            positions = [measured[name] for name in joints]
            self._send_point(group, joints, positions, _HOLD_TIME)

    def _send_point(
        self, group: str, joints: tuple[str, ...], positions: list[float], seconds: float
    ) -> None:
        message = conversions.joint_trajectory_to_message(
            list(joints), np.array([seconds]), np.array([positions])
        )
        self._publishers[group].publish(message)
