"""The simulated cell on the topics that a real robot with an RGB-D camera has.

Nothing downstream can tell it from a robot driven by ros2_control. The cloth is given from outside
(`emd_core.simulated_cloth`), so that this package needs no cloth solver.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

import numpy as np
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMsg

from emd_arm_executor.hiro.camera import HeadCamera
from emd_arm_executor.hiro.camera_noise import KinectNoise
from emd_arm_executor.hiro.cell_simulation import CellSimulation
from emd_arm_executor.hiro.description import JOINT_GROUPS, JOINT_NAMES, URDF_PATH
from emd_arm_executor.hiro.overview import OverviewCamera
from emd_arm_executor.hiro.trajectory_following import CommandedTrajectory
from emd_arm_executor.hiro.world import HiroWorld
from emd_arm_executor.ros.camera_publisher import CameraPublisher
from emd_arm_executor.ros.simulation_config import SimulationConfig
from emd_arm_executor.ros.truth_publisher import TruthPublisher
from emd_core.errors import CellError
from emd_core.ros import conversions
from emd_core.ros.heartbeat import Heartbeat
from emd_core.ros.parameters import declare_config
from emd_core.ros.quality_of_service import LATCHED
from emd_core.simulated_cloth import SimulatedCloth


class SimulationNode(Node):
    """Steps robot and cloth and publishes what sensors would."""

    def __init__(self, make_cloth: Callable[[], SimulatedCloth]) -> None:
        """Build the world; `make_cloth` lays a cloth on the table, now and at every reset."""
        super().__init__("simulation")
        self._config = declare_config(self, SimulationConfig())
        self._make_cloth = make_cloth
        self._world = HiroWorld(gui=self._config.gui)
        self._simulation = CellSimulation(self._world, make_cloth())
        noise = KinectNoise(np.random.default_rng(self._config.seed))
        camera = HeadCamera(self._world, noise=noise if self._config.noise else None)
        self._overview = OverviewCamera(self._world, camera.renderer)
        # The first pictures compile the renderer, which must not hold up simulated time later.
        camera.capture(self._simulation.cloth)
        self._overview.capture(self._simulation.cloth)
        self._camera_publisher = CameraPublisher(self, camera)
        self._truth_publisher = TruthPublisher(self)
        self._advertise()
        self._due: dict[str, float] = {}
        self._started = time.monotonic()
        self._heartbeat = Heartbeat(self, "world", lambda: None)
        self.create_timer(1e-3, self._on_timer)

    def _advertise(self) -> None:
        self._clock_publisher = self.create_publisher(Clock, "/clock", 10)
        self._joints = self.create_publisher(JointState, "joint_states", 10)
        self._film = self.create_publisher(Image, "simulation/overview/image_raw", 5)
        self._description = self.create_publisher(String, "robot_description", LATCHED)
        self._description.publish(String(data=URDF_PATH.read_text()))
        for group in JOINT_GROUPS:
            topic = f"{group}_controller/joint_trajectory"
            self.create_subscription(
                JointTrajectoryMsg, topic, partial(self._on_trajectory, group), 10
            )
        self.create_service(Trigger, "simulation/reset", self._on_reset)

    def _on_trajectory(self, group: str, message: JointTrajectoryMsg) -> None:
        try:
            start = conversions.time_from_message(message.header.stamp) or None
            self._simulation.follow(group, _trajectory_from_message(message), start)
        except CellError as err:  # as a controller does: refuse, say why, go on as before
            self.get_logger().error(f"{group} trajectory refused: {err}")

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._simulation.reset()
        self._simulation.replace_cloth(self._make_cloth())
        response.success, response.message = True, "robot at its observing posture, cloth flat"
        return response

    def _on_timer(self) -> None:
        """Step once, unless the simulation is ahead of the wall clock."""
        factor = self._config.real_time_factor
        ahead = self._simulation.time - (time.monotonic() - self._started) * factor
        if factor > 0 and ahead > self._config.step:
            time.sleep(min(ahead / factor, 0.01))
            return
        if factor > 0 and ahead < -0.5:
            self._started = time.monotonic() - self._simulation.time / factor  # never catch up
        self._simulation.step(self._config.step)
        stamp = conversions.time_to_message(self._simulation.time)
        self._clock_publisher.publish(Clock(clock=stamp))
        self._publish_joints()
        if self._is_due("camera", self._config.camera_rate):
            self._camera_publisher.publish(self._simulation.cloth, self._simulation.time)
        if self._is_due("truth", self._config.truth_rate):
            self._truth_publisher.publish(self._simulation.cloth, self._simulation.time)
        if self._config.overview.enabled and self._is_due("film", self._config.overview.rate):
            self._publish_film()

    def _publish_film(self) -> None:
        """Film, if anyone looks."""
        if self._film.get_subscription_count() > 0:
            header = conversions.header(self._simulation.time, "overview")
            self._camera_publisher.finish()
            image = self._overview.capture(self._simulation.cloth)
            self._film.publish(conversions.image_to_message(image, "rgb8", header))

    def _is_due(self, what: str, rate: float) -> bool:
        """Whether the next of something that comes `rate` times a simulated second is due."""
        now = self._simulation.time
        if rate <= 0 or now < self._due.get(what, 0.0) - 1e-9:
            return False
        self._due[what] = max(self._due.get(what, 0.0) + 1.0 / rate, now)
        return True

    def _publish_joints(self) -> None:
        positions, velocities, efforts = self._world.joint_states.tolist()
        message = JointState(
            header=conversions.header(self._simulation.time, ""),
            name=list(JOINT_NAMES),
            position=positions,
            velocity=velocities,
            effort=efforts,
        )
        self._joints.publish(message)

    def destroy_node(self) -> None:
        """Finish the last picture, leave PyBullet, then the graph."""
        self._camera_publisher.close()
        self._world.close()
        super().destroy_node()


def _trajectory_from_message(message: JointTrajectoryMsg) -> CommandedTrajectory:
    points = message.points
    times = np.array([conversions.time_from_message(point.time_from_start) for point in points])
    columns = {
        name: np.array([getattr(point, name) for point in points])
        for name in ("positions", "velocities", "accelerations")
    }
    optional = {
        name: values if values.size else None
        for name, values in columns.items()
        if name != "positions"
    }
    return CommandedTrajectory(tuple(message.joint_names), times, columns["positions"], **optional)
