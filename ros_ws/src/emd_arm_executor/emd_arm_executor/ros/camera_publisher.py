"""The simulated head camera on the topics of an RGB-D camera's driver."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, Image

from emd_arm_executor.hiro.camera import CameraFrame, CameraView, HeadCamera
from emd_core.frames import FloatArray
from emd_core.ros import conversions
from emd_core.ros.quality_of_service import LATCHED
from emd_core.simulated_cloth import SimulatedCloth


class CameraPublisher:
    """Publishes colour, depth (16UC1 mm and 32FC1 m), calibration and pose.

    A thread of its own draws the pictures, so that the simulation goes on meanwhile.
    """

    def __init__(self, node: Node, camera: HeadCamera) -> None:
        """Advertise the topics."""
        self._camera = camera
        self._colour = node.create_publisher(Image, "camera/color/image_raw", 5)
        self._depth_mm = node.create_publisher(Image, "camera/depth_registered/image_raw", 5)
        self._depth_m = node.create_publisher(Image, "camera/depth_registered/image", 5)
        self._infos = [
            node.create_publisher(CameraInfo, f"camera/{kind}/camera_info", 5)
            for kind in ("color", "depth_registered")
        ]
        self._pose = node.create_publisher(PoseStamped, "camera/pose", LATCHED)
        self._last_pose: FloatArray | None = None
        self._photographer = ThreadPoolExecutor(1, "camera")
        self._picture: Future[None] | None = None

    def publish(self, cloth: SimulatedCloth, time: float) -> None:
        """Take a pair of images if anyone looks; a picture costs more than all the rest.

        It is published as soon as it is drawn. Where pictures are due faster than they are drawn,
        this waits, so that none is left out.

        Args:
            cloth: What lies on the table.
            time: Simulated seconds.
        """
        self._publish_pose(time)
        images = (self._colour, self._depth_mm, self._depth_m)
        if not any(publisher.get_subscription_count() for publisher in images):
            return
        self.finish()
        view = self._camera.view(cloth)
        self._picture = self._photographer.submit(self._publish_picture, view, time)

    def finish(self) -> None:
        """Wait for the picture that is being drawn; nobody else may use its renderer before."""
        picture, self._picture = self._picture, None
        if picture is not None:
            picture.result()

    def close(self) -> None:
        """Wait for the picture that is being drawn, whether or not it can still be published."""
        self._photographer.shutdown()

    def _publish_picture(self, view: CameraView, time: float) -> None:
        frame = self._camera.take(view)
        header = conversions.header(time, conversions.CAMERA_FRAME)
        for publisher in self._infos:
            publisher.publish(conversions.camera_to_message(frame.camera, header))
        self._colour.publish(conversions.image_to_message(frame.colour, "rgb8", header))
        self._publish_depth(frame, time)

    def _publish_depth(self, frame: CameraFrame, time: float) -> None:
        header = conversions.header(time, conversions.CAMERA_FRAME)
        if self._depth_mm.get_subscription_count():
            millimetres = np.nan_to_num(frame.depth * 1000.0).round().astype(np.uint16)
            self._depth_mm.publish(conversions.image_to_message(millimetres, "16UC1", header))
        if self._depth_m.get_subscription_count():
            self._depth_m.publish(conversions.image_to_message(frame.depth, "32FC1", header))

    def _publish_pose(self, time: float) -> None:
        """Publish the camera's pose when it has changed; the topic keeps the last one."""
        pose = self._camera.transform_camera_to_table
        if self._last_pose is not None and np.allclose(pose, self._last_pose, atol=1e-5):
            return
        self._last_pose = pose
        header = conversions.header(time, conversions.TABLE_FRAME)
        self._pose.publish(PoseStamped(header=header, pose=conversions.pose_to_message(pose)))
