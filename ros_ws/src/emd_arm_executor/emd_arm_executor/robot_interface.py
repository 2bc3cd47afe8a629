"""What the executor needs of a robot; simulation, mock and ROS driver offer the same."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

from emd_arm_executor.joint_trajectory import JointTrajectory


@dataclass(frozen=True)
class JointReading:
    """What the encoders said.

    Attributes:
        time: When they were read, seconds of the robot's time.
        positions: Position of every joint, radians.
    """

    time: float
    positions: Mapping[str, float]


class RobotInterface(ABC):
    """A robot with joint groups that follow trajectories and hands that open and close."""

    @abstractmethod
    def now(self) -> float:
        """Give the robot's time, seconds."""

    @abstractmethod
    def wait_until(self, time: float) -> None:
        """Return when the robot's time has reached `time`, seconds; at once if it has passed."""

    @abstractmethod
    def read_joints(self) -> JointReading:
        """Give the latest measured position of every joint and when it was measured."""

    def joint_positions(self) -> Mapping[str, float]:
        """Give the latest measured position of every joint, radians."""
        return self.read_joints().positions

    @abstractmethod
    def send_trajectory(self, group: str, trajectory: JointTrajectory, start_time: float) -> None:
        """Let a joint group follow a trajectory; it replaces what the group follows now.

        Args:
            group: Name of the joint group, for example "left_arm".
            trajectory: Of exactly the group's joints.
            start_time: Robot's time at which the trajectory begins, seconds.
        """

    @abstractmethod
    def send_gripper(self, arm: str, width: float) -> None:
        """Open or close the jaws of an arm's hand to a width, metres."""

    @abstractmethod
    def gripper_width(self, arm: str) -> float:
        """Give the measured opening of an arm's jaws, metres; cloth between them keeps it up."""

    @abstractmethod
    def hold(self) -> None:
        """Make every group stay where it is, without regard to smoothness; the last resort."""
