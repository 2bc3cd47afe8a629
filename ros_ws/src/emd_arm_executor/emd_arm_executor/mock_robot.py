"""A robot that obeys perfectly in virtual time, so that tests of the executor take no time."""

from __future__ import annotations

from dataclasses import dataclass, field

from emd_arm_executor.joint_trajectory import JointTrajectory
from emd_arm_executor.robot_interface import JointReading, RobotInterface


@dataclass(frozen=True)
class SentTrajectory:
    """A trajectory as it was sent.

    Attributes:
        group: Joint group.
        trajectory: What it was to follow.
        start_time: When it began, seconds.
    """

    group: str
    trajectory: JointTrajectory
    start_time: float


@dataclass
class MockRobot(RobotInterface):
    """Follows trajectories exactly; waiting moves the clock on.

    Attributes:
        positions: Position of every joint, radians; changed by trajectories.
        holding_width: Opening at which closing jaws stop, as if cloth were between them, metres.
        tracking_offset: Added to the position of every joint that is asked for, radians; lets a
            test pretend that the robot does not follow.
        reading_age: How old the positions are that it gives, as over a slow network, seconds.
        time: The clock, seconds.
        sent: Every trajectory that came, in its order.
        gripper_commands: Every (time, arm, width) that came, in its order.
    """

    positions: dict[str, float]
    holding_width: float = 0.002
    tracking_offset: float = 0.0
    reading_age: float = 0.0
    time: float = 0.0
    sent: list[SentTrajectory] = field(default_factory=list)
    gripper_commands: list[tuple[float, str, float]] = field(default_factory=list)
    _active: dict[str, SentTrajectory] = field(default_factory=dict)
    _widths: dict[str, float] = field(default_factory=dict)

    def now(self) -> float:
        """Give the virtual time, seconds."""
        return self.time

    def wait_until(self, time: float) -> None:
        """Set the clock forward."""
        self.time = max(self.time, time)

    def read_joints(self) -> JointReading:
        """Sample all active trajectories at the time of the reading, radians."""
        time = self.time - self.reading_age
        for sent in self._active.values():
            values = sent.trajectory.sample(time - sent.start_time)
            self.positions.update(zip(sent.trajectory.joint_names, values.tolist(), strict=True))
        offset = self.tracking_offset
        return JointReading(time, {name: x + offset for name, x in self.positions.items()})

    def send_trajectory(self, group: str, trajectory: JointTrajectory, start_time: float) -> None:
        """Follow a trajectory from its start time on."""
        self.read_joints()
        sent = SentTrajectory(group, trajectory, start_time)
        self._active[group] = sent
        self.sent.append(sent)

    def send_gripper(self, arm: str, width: float) -> None:
        """Move the jaws at once."""
        self.gripper_commands.append((self.time, arm, width))
        self._widths[arm] = max(width, self.holding_width)

    def gripper_width(self, arm: str) -> float:
        """Give the width last sent, or that of the pretended cloth, metres."""
        return self._widths.get(arm, self.holding_width)

    def hold(self) -> None:
        """Freeze all joints at their present positions."""
        self.read_joints()
        self._active.clear()
