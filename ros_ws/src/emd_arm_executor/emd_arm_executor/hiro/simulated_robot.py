"""The simulated cell as a robot that the executor can drive without ROS."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from emd_arm_executor.hiro.cell_simulation import CellSimulation
from emd_arm_executor.hiro.description import HANDS, JOINT_GROUPS, JOINT_NAMES
from emd_arm_executor.hiro.trajectory_following import CommandedTrajectory
from emd_arm_executor.joint_trajectory import JointTrajectory
from emd_arm_executor.robot_interface import JointReading, RobotInterface
from emd_core.errors import InvalidInputError


class SimulatedRobot(RobotInterface):
    """Time is the simulation's: waiting steps it, as fast as the machine can."""

    def __init__(
        self,
        simulation: CellSimulation,
        gripper_time: float = 0.4,
        step: float = 1.0 / 60.0,
        on_step: Callable[[], None] | None = None,
    ) -> None:
        """Drive a simulated cell.

        Args:
            simulation: The cell.
            gripper_time: How long the jaws take to open or close, seconds.
            step: Simulated time between two calls of `on_step`, seconds.
            on_step: Called while time goes on, for example to take pictures.
        """
        self.simulation = simulation
        self._gripper_time = gripper_time
        self._step = step
        self._on_step = on_step or (lambda: None)

    def now(self) -> float:
        """Give the simulated time, seconds."""
        return self.simulation.time

    def wait_until(self, time: float) -> None:
        """Simulate until `time`, seconds."""
        while self.simulation.time < time:
            remaining = time - self.simulation.time
            # At least one time step, or a remainder below one would never pass.
            shortest = self.simulation.world.config.time_step
            self.simulation.step(max(min(self._step, remaining), shortest))
            self._on_step()

    def read_joints(self) -> JointReading:
        """Give the measured position of every joint, radians."""
        positions = self.simulation.world.joint_positions.tolist()
        return JointReading(self.now(), dict(zip(JOINT_NAMES, positions, strict=True)))

    def send_trajectory(self, group: str, trajectory: JointTrajectory, start_time: float) -> None:
        """Let a joint group follow a trajectory from its start time on."""
        commanded = CommandedTrajectory(
            trajectory.joint_names,
            trajectory.times,
            trajectory.positions,
            trajectory.velocities,
            trajectory.accelerations,
        )
        self.simulation.follow(group, commanded, start_time)

    def send_gripper(self, arm: str, width: float) -> None:
        """Open or close the jaws of an arm's hand to a width, metres."""
        group = JOINT_GROUPS[f"{HANDS[_hand(arm)]}_gripper"]
        angles = self.simulation.world.gripper.joints_from_width(width)
        still = np.zeros((1, len(angles)))
        target = CommandedTrajectory(
            group.joints, np.array([self._gripper_time]), angles[None], still
        )
        self.simulation.follow(group.name, target)

    def gripper_width(self, arm: str) -> float:
        """Give the measured opening of an arm's jaws, metres."""
        return self.simulation.world.gripper_width(_hand(arm))

    def hold(self) -> None:
        """Make every group stay where its trajectory has got to."""
        for group in JOINT_GROUPS:
            self.simulation.hold(group)


def _hand(arm: str) -> int:
    if arm not in HANDS:
        raise InvalidInputError(f"an arm of {HANDS} is wanted, got {arm!r}")
    return HANDS.index(arm)
