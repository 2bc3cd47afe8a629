"""The simulated cell on the topics that a real robot with an RGB-D camera has.

Nothing downstream can tell it from a robot driven by ros2_control. The cloth is given from outside
(`emd_core.simulated_cloth`), so that this package needs no cloth solver.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, JointState, PointCloud2
from std_msgs.msg import Header, String
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMsg

from emd_arm_executor.hiro.camera import CameraFrame, HeadCamera
from emd_arm_executor.hiro.camera_noise import KinectNoise
from emd_arm_executor.hiro.cell_simulation import CellSimulation
from emd_arm_executor.hiro.description import JOINT_GROUPS, JOINT_NAMES, URDF_PATH
from emd_arm_executor.hiro.overview import OverviewCamera
from emd_arm_executor.hiro.trajectory_following import CommandedTrajectory
from emd_arm_executor.hiro.world import HiroWorld
from emd_core.errors import CellError
from emd_core.frames import FieldOfView
from emd_core.ros import conversions
from emd_core.ros.parameters import declare_config
from emd_core.simulated_cloth import SimulatedCloth
from emd_core.voxel_grid import voxelise
from emd_msgs_py.msg import VoxelGrid as VoxelGridMsg


@dataclass(frozen=True)
class OverviewConfig:
    """A second camera that films the scene from the side.

    Attributes:
        enabled: Whether it films.
        rate: Pictures a simulated second.
    """

    enabled: bool = False
    rate: float = 5.0


@dataclass(frozen=True)
class SimulationConfig:
    """How the simulation runs.

    Attributes:
        seed: Of the camera's noise.
        gui: Whether PyBullet opens its window.
        noise: Whether the camera has a Kinect's noise.
        real_time_factor: Simulated seconds a second at most; 0: as fast as possible.
        step: Simulated seconds between two messages of /clock and joint_states.
        camera_rate: Pairs of images a simulated second.
        truth_rate: True voxel grids and cloth states a simulated second.
        overview: The second camera.
    """

    seed: int = 0
    gui: bool = False
    noise: bool = True
    real_time_factor: float = 1.0
    step: float = 1.0 / 60.0
    camera_rate: float = 10.0
    truth_rate: float = 5.0
    overview: OverviewConfig = field(default_factory=OverviewConfig)


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
        self._camera = HeadCamera(self._world, noise=noise if self._config.noise else None)
        self._overview = OverviewCamera(self._world, self._camera.renderer)
        # The first pictures compile the renderer, which must not hold up simulated time later.
        self._camera.capture(self._simulation.cloth)
        self._overview.capture(self._simulation.cloth)
        self._advertise()
        self._due: dict[str, float] = {}
        self._camera_pose: np.ndarray | None = None
        self._started = time.monotonic()
        self.create_timer(1e-3, self._on_timer)

    def _advertise(self) -> None:
        latched = QoSProfile(
            depth=1,
            reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL,
        )
        self._clock_publisher = self.create_publisher(Clock, "/clock", 10)
        self._joints = self.create_publisher(JointState, "joint_states", 10)
        self._colour = self.create_publisher(Image, "camera/color/image_raw", 5)
        self._depth_mm = self.create_publisher(Image, "camera/depth_registered/image_raw", 5)
        self._depth_m = self.create_publisher(Image, "camera/depth_registered/image", 5)
        self._info = self.create_publisher(CameraInfo, "camera/color/camera_info", 5)
        self._depth_info = self.create_publisher(
            CameraInfo, "camera/depth_registered/camera_info", 5
        )
        self._pose = self.create_publisher(PoseStamped, "camera/pose", latched)
        self._truth = self.create_publisher(VoxelGridMsg, "simulation/voxel_grid", 5)
        self._cloth = self.create_publisher(PointCloud2, "simulation/cloth", 5)
        self._film = self.create_publisher(Image, "simulation/overview/image_raw", 5)
        self._description = self.create_publisher(String, "robot_description", latched)
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
            self._publish_camera()
        if self._is_due("truth", self._config.truth_rate):
            self._publish_truth()
        if self._config.overview.enabled and self._is_due("film", self._config.overview.rate):
            header = conversions.header(stamp, "overview")
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
        message = JointState(
            header=conversions.header(self._simulation.time, ""),
            name=list(JOINT_NAMES),
            position=self._world.joint_positions.tolist(),
            velocity=self._world.joint_velocities.tolist(),
            effort=self._world.joint_efforts.tolist(),
        )
        self._joints.publish(message)

    def _publish_camera(self) -> None:
        """Publish a pair of images if anyone looks; a picture costs more than all the rest."""
        self._publish_pose()
        images = (self._colour, self._depth_mm, self._depth_m)
        if not any(publisher.get_subscription_count() for publisher in images):
            return
        frame = self._camera.capture(self._simulation.cloth)
        header = conversions.header(self._simulation.time, conversions.CAMERA_FRAME)
        info = conversions.camera_to_message(frame.camera, header)
        self._info.publish(info)
        self._depth_info.publish(info)
        self._colour.publish(conversions.image_to_message(frame.colour, "rgb8", header))
        self._publish_depth(frame, header)

    def _publish_depth(self, frame: CameraFrame, header: Header) -> None:
        if self._depth_mm.get_subscription_count():
            millimetres = np.nan_to_num(frame.depth * 1000.0).round().astype(np.uint16)
            self._depth_mm.publish(conversions.image_to_message(millimetres, "16UC1", header))
        if self._depth_m.get_subscription_count():
            self._depth_m.publish(conversions.image_to_message(frame.depth, "32FC1", header))

    def _publish_pose(self) -> None:
        """Publish the camera's pose when it has changed; the topic keeps the last one."""
        pose = self._camera.transform_camera_to_table
        if self._camera_pose is not None and np.allclose(pose, self._camera_pose, atol=1e-5):
            return
        self._camera_pose = pose
        header = conversions.header(self._simulation.time, conversions.TABLE_FRAME)
        self._pose.publish(PoseStamped(header=header, pose=conversions.pose_to_message(pose)))

    def _publish_truth(self) -> None:
        cloth = self._simulation.cloth
        header = conversions.header(self._simulation.time, conversions.TABLE_FRAME)
        points = cloth.positions_in_table
        self._cloth.publish(conversions.points_to_message(points, header))
        upper_surface = points + np.array([0.0, 0.0, cloth.thickness / 2])
        grid = voxelise(upper_surface, FieldOfView())
        self._truth.publish(conversions.voxel_grid_to_message(grid, header))

    def destroy_node(self) -> None:
        """Leave PyBullet, then the graph."""
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
