"""Records topics into a rosbag2 (mcap) without decoding them."""

from __future__ import annotations

import importlib
import sys
from functools import partial
from pathlib import Path
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosbags.rosbag2 import StoragePlugin, Writer

from emd_cell.bag_types import cell_typestore
from emd_core.errors import InvalidInputError
from emd_core.ros.quality_of_service import LATCHED
from emd_core.ros.spin import spin_node

# Camera, state, intent and result: enough to replay perception and to see what the arms did.
RECORDED_TOPICS = {
    "/camera/color/image_raw": "sensor_msgs/msg/Image",
    "/camera/color/camera_info": "sensor_msgs/msg/CameraInfo",
    "/camera/depth_registered/image_raw": "sensor_msgs/msg/Image",
    "/camera/pose": "geometry_msgs/msg/PoseStamped",
    "/joint_states": "sensor_msgs/msg/JointState",
    "/robot_description": "std_msgs/msg/String",
    "/left_arm_controller/joint_trajectory": "trajectory_msgs/msg/JointTrajectory",
    "/right_arm_controller/joint_trajectory": "trajectory_msgs/msg/JointTrajectory",
    "/left_gripper_controller/joint_trajectory": "trajectory_msgs/msg/JointTrajectory",
    "/right_gripper_controller/joint_trajectory": "trajectory_msgs/msg/JointTrajectory",
    "/perception/voxel_grid": "emd_msgs_py/msg/VoxelGrid",
    "/simulation/voxel_grid": "emd_msgs_py/msg/VoxelGrid",
}
_LATCHED = ("/robot_description", "/camera/pose")


class RecorderNode(Node):
    """Writes every message of the recorded topics to the bag `directory`, as it arrives.

    With the parameter `reliable`, lost messages are asked for again, which needs publishers that
    offer it; large images get lost otherwise when the machine is busy.
    """

    def __init__(self) -> None:
        """Open the bag.

        Raises:
            InvalidInputError: If the directory exists already: a bag is never overwritten.
        """
        super().__init__("recorder")
        self._reliable = self.declare_parameter("reliable", False).value
        directory = Path(self.declare_parameter("directory", "bag").value)
        if directory.exists():
            raise InvalidInputError(
                f"{directory} exists already; a bag is never overwritten, name another directory"
            )
        directory.parent.mkdir(parents=True, exist_ok=True)
        self._writer = Writer(directory, version=9, storage_plugin=StoragePlugin.MCAP)
        self._writer.open()
        typestore = cell_typestore()
        for topic, name in RECORDED_TOPICS.items():
            connection = self._writer.add_connection(topic, name, typestore=typestore)
            self.create_subscription(
                message_class(name),
                topic,
                partial(self._write, connection),
                self._quality_of_service(topic),
                raw=True,
            )

    def _write(self, connection: Any, data: bytes) -> None:
        self._writer.write(connection, self.get_clock().now().nanoseconds, data)

    def _quality_of_service(self, topic: str) -> QoSProfile:
        """Best effort suits every publisher; latched topics are asked for their last message."""
        if topic in _LATCHED:
            return LATCHED
        reliability = (
            ReliabilityPolicy.RELIABLE if self._reliable else ReliabilityPolicy.BEST_EFFORT
        )
        return QoSProfile(depth=50, reliability=reliability)

    def destroy_node(self) -> None:
        """Finish the bag, then the node."""
        self._writer.close()
        super().destroy_node()


def message_class(name: str) -> type:
    """Find the class of a message such as `sensor_msgs/msg/Image`."""
    package, _, kind = name.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), kind)  # type: ignore[no-any-return]


def main() -> int:
    """Record until interrupted."""
    return spin_node(RecorderNode)


if __name__ == "__main__":
    sys.exit(main())
