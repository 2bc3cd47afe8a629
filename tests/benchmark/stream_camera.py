"""A camera that sees a scene of the perception benchmark: python stream_camera.py RATE_HZ."""

import sys
import time
from typing import Any

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header

from emd_cell.scenes.scene import Scene, SceneMaker
from emd_cloth_sim.config import ClothConfig
from emd_core.ros import conversions
from emd_core.ros.quality_of_service import LATCHED

FRAMES = 10


class StreamCamera(Node):
    """Publishes the noisy frames of a scene over and over, with the stamps of now."""

    def __init__(self, scene: Scene) -> None:
        """Advertise the camera's topics and say where it is."""
        super().__init__("stream_camera")
        make, keep = self.create_publisher, QoSProfile(depth=5)
        self._colour = make(Image, "camera/color/image_raw", keep)
        self._depth = make(Image, "camera/depth_registered/image_raw", keep)
        self._info = make(CameraInfo, "camera/color/camera_info", keep)
        self._pose = make(PoseStamped, "camera/pose", LATCHED)
        self._camera = scene.camera
        pose = conversions.pose_to_message(scene.transform_camera_to_table)
        self._pose.publish(PoseStamped(header=self._header(), pose=pose))
        self._images = [
            self._messages(colour, depth)
            for colour, depth in zip(scene.colours, scene.depths, strict=True)
        ]

    def publish(self, number: int) -> None:
        """Send the frame of that number."""
        header = self._header()
        colour, depth = self._images[number % len(self._images)]
        colour.header = depth.header = header
        self._info.publish(conversions.camera_to_message(self._camera, header))
        self._colour.publish(colour)
        self._depth.publish(depth)

    def _messages(self, colour: Any, depth: Any) -> tuple[Image, Image]:
        millimetres = np.nan_to_num(1e3 * depth).round().astype(np.uint16)
        return (
            conversions.image_to_message(colour, "rgb8", self._header()),
            conversions.image_to_message(millimetres, "16UC1", self._header()),
        )

    def _header(self) -> Header:
        now = self.get_clock().now().nanoseconds * 1e-9
        return conversions.header(now, conversions.CAMERA_FRAME)


def main(rate: float) -> None:
    """Publish until killed; a late frame is sent at once, a second's delay is given up."""
    scene = SceneMaker(0, ClothConfig(vertices=(41, 41), thickness=0.003), FRAMES).make(1)
    rclpy.init()
    camera = StreamCamera(scene)
    due, number = time.monotonic(), 0
    while True:
        camera.publish(number)
        number, due = number + 1, max(due + 1.0 / rate, time.monotonic() - 1.0)
        time.sleep(max(0.0, due - time.monotonic()))


if __name__ == "__main__":
    main(float(sys.argv[1]))
