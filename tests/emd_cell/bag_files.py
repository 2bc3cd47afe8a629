"""Bags of a small camera that sees a cloth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from perception_scenes import BLUE, Layer, Scene, rectangle, render
from rclpy.serialization import serialize_message
from rosbags.convert.converter import convert
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from emd_cell.bag_reader import BagTopics
from emd_cell.bag_types import cell_typestore
from emd_core.pinhole_camera import PinholeCamera
from emd_core.ros import conversions

CAMERA = PinholeCamera(320, 240, 262.5, 262.5, 159.5, 119.5)
TOPICS = BagTopics()
_TYPES = {
    "color": "sensor_msgs/msg/Image",
    "depth": "sensor_msgs/msg/Image",
    "points": "sensor_msgs/msg/PointCloud2",
    "info": "sensor_msgs/msg/CameraInfo",
    "pose": "geometry_msgs/msg/PoseStamped",
}


@dataclass(frozen=True)
class Recorded:
    """One message of a bag: kind, time of its writing (ns), and its bytes."""

    kind: str
    time: int
    data: bytes


def cloth_scene(frames: int) -> Scene:
    """A blue cloth, half as many pixels a side as usual."""
    scene = render([Layer(rectangle(0.4, 0.4, turn=0.2), 0.003, BLUE)], frames=frames, seed=4)
    size = (CAMERA.width, CAMERA.height)
    depths = [cv2.resize(d, size, interpolation=cv2.INTER_NEAREST) for d in scene.depth_frames]
    colour = cv2.resize(scene.colour, size, interpolation=cv2.INTER_AREA)
    return replace(scene, colour=colour, depth_frames=depths)


def header_at(stamp: int) -> Any:
    """A header with a stamp in nanoseconds."""
    made = conversions.header(0.0, conversions.CAMERA_FRAME)
    made.stamp.sec, made.stamp.nanosec = divmod(stamp, 1_000_000_000)
    return made


def colour_message(scene: Scene, stamp: int) -> Any:
    """The scene's colour image."""
    return conversions.image_to_message(scene.colour, "rgb8", header_at(stamp))


def depth_message(scene: Scene, stamp: int, index: int = 0) -> Any:
    """One of the scene's depth images, millimetres."""
    depth = np.nan_to_num(np.rint(1e3 * scene.depth_frames[index])).astype(np.uint16)
    return conversions.image_to_message(depth, "16UC1", header_at(stamp))


def recorded(kind: str, stamp: int, message: Any) -> Recorded:
    """A message as the middleware sends it."""
    return Recorded(kind, stamp, serialize_message(message))


def calibration_and_pose(
    scene: Scene, stamp: int = 0, camera: PinholeCamera = CAMERA
) -> list[Recorded]:
    """What precedes the images."""
    from geometry_msgs.msg import PoseStamped

    pose = conversions.pose_to_message(scene.transform_camera_to_table)
    stamped = PoseStamped(header=header_at(stamp), pose=pose)
    info = conversions.camera_to_message(camera, header_at(stamp))
    return [recorded("info", stamp, info), recorded("pose", stamp, stamped)]


def pairs(scene: Scene, stamps: Sequence[int]) -> list[Recorded]:
    """Colour and depth at each stamp, cycling through the scene's depth images."""
    found = []
    for number, stamp in enumerate(stamps):
        index = number % len(scene.depth_frames)
        found.append(recorded("color", stamp, colour_message(scene, stamp)))
        found.append(recorded("depth", stamp, depth_message(scene, stamp, index)))
    return found


def write_bag(path: Path, messages: Sequence[Recorded], sqlite: bool = False) -> Path:
    """Write a rosbag2."""
    store = cell_typestore()
    plugin = StoragePlugin.SQLITE3 if sqlite else StoragePlugin.MCAP
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        connections: dict[str, Any] = {}
        for message in messages:
            if message.kind not in connections:
                topic = getattr(TOPICS, "depth" if message.kind == "points" else message.kind)
                connections[message.kind] = writer.add_connection(
                    topic, _TYPES[message.kind], typestore=store
                )
            writer.write(connections[message.kind], message.time, message.data)
    return path


def as_ros1(bag: Path, path: Path) -> Path:
    """Write a rosbag2 anew as a .bag of ROS 1."""
    noetic = get_typestore(Stores.ROS1_NOETIC)
    nothing: list[str] = []
    convert(
        [bag], path, "mcap", 9, None, "file", cell_typestore(), noetic,
        nothing, nothing, nothing, nothing,
    )  # fmt: skip
    return path
