"""The simulated HIRO as a robot for the executor, in this process and without ROS."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from emd_arm_executor.hiro.cell_simulation import CellSimulation
from emd_arm_executor.hiro.description import HANDS, JOINT_NAMES
from emd_arm_executor.hiro.trajectory_following import CommandedTrajectory
from emd_arm_executor.joint_trajectory import JointTrajectory
from emd_arm_executor.robot_interface import RobotInterface


class SimulatedRobot(RobotInterface):
    """Drives a `CellSimulation`; waiting lets simulated time pass."""

    def __init__(
        self,
        simulation: CellSimulation,
        gripper_time: float = 0.4,
        on_step: Callable[[], None] | None = None,
    ) -> None:
        """Connect to a simulation.

        Args:
            simulation: Robot and cloth.
            gripper_time: Time in which jaws move to a commanded width, seconds.
            on_step: Called after every stretch of simulated time, for instance to take pictures.
        """
        self.simulation = simulation
        self._gripper_time = gripper_time
        self._on_step = on_step or (lambda: None)

    def now(self) -> float:
        """Give the simulated time, seconds."""
        return self.simulation.time

    def wait_until(self, time: float) -> None:
        """Simulate until the given time."""
        self.simulation.step(max(time - self.simulation.time, 0.0))
        self._on_step()

    def joint_positions(self) -> Mapping[str, float]:
        """Measure all joints, radians."""
        measured = self.simulation.world.joint_positions
        return dict(zip(JOINT_NAMES, measured.tolist(), strict=True))

    def send_trajectory(self, group: str, trajectory: JointTrajectory, start_time: float) -> None:
        """Follow a trajectory; one that began a little earlier or later is shifted in time."""
        delay = max(start_time - self.simulation.time, 0.0)
        commanded = CommandedTrajectory(
            trajectory.joint_names,
            trajectory.times + delay,
            trajectory.positions,
            trajectory.velocities,
            trajectory.accelerations,
        )
        self.simulation.follow(group, commanded)

    def send_gripper(self, arm: str, width: float) -> None:
        """Move the jaws to a width within the gripper's time."""
        world = self.simulation.world
        goal = world.gripper.joints_from_width(width)
        group = f"{arm}_gripper"
        start = world.group_positions(group)
        names = tuple(n for n in JOINT_NAMES if n.startswith(f"{arm[0].upper()}HAND"))
        times = np.array([0.0, self._gripper_time])
        still = np.zeros((2, len(names)))
        positions = np.stack([start, goal])
        self.simulation.follow(group, CommandedTrajectory(names, times, positions, still))

    def gripper_width(self, arm: str) -> float:
        """Measure the opening of the jaws, metres."""
        return self.simulation.world.gripper_width(HANDS.index(arm))

    def hold(self) -> None:
        """Stop every group where its trajectory has got to."""
        for hand in HANDS:
            self.simulation.hold(f"{hand}_arm")
            self.simulation.hold(f"{hand}_gripper")
