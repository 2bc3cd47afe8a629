"""The motion of one manipulation: its messages, kept until they are written as one bag."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

MOTION = "motion"  # the bag's folder in an example's
JOINTS, DESCRIPTION, CAMERA_POSE = "/joint_states", "/robot_description", "/camera/pose"
JOINT_STATE = "sensor_msgs/msg/JointState"
TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
POSE = "geometry_msgs/msg/PoseStamped"
STRING = "std_msgs/msg/String"
PHASE = "/arm_executor/phase"  # tells when a phase begins; made of the action's feedback

# Of one motion, bytes; a minute of HIRO's takes about 5 MB. What is longer is not kept at all.
LARGEST = 256 * 1024 * 1024
TYPES = get_typestore(Stores.ROS2_JAZZY)


@dataclass(frozen=True)
class MotionMessage:
    """A message as it came.

    Attributes:
        topic: Its full name.
        kind: Its type, such as `sensor_msgs/msg/JointState`.
        stamp: When it came, nanoseconds.
        data: CDR.
    """

    topic: str
    kind: str
    stamp: int
    data: bytes


class MotionLog:
    """Messages of one motion, in the order in which they came."""

    def __init__(self) -> None:
        """Nothing came yet."""
        self._messages: list[MotionMessage] = []
        self._bytes = 0
        self._phase = ""

    def add(self, message: MotionMessage) -> None:
        """Keep a message."""
        self._bytes += len(message.data)
        if self._bytes <= LARGEST:
            self._messages.append(message)

    def enter(self, phase: str, stamp: int) -> None:
        """Note in which phase the motion is."""
        if phase != self._phase:
            self._phase = phase
            text = TYPES.types[STRING](data=phase)
            self.add(MotionMessage(PHASE, STRING, stamp, bytes(TYPES.serialize_cdr(text, STRING))))

    def _seconds(self) -> float:
        """How long the motion took, by the robot's clock."""
        states = [item.data for item in self._messages if item.topic == JOINTS]
        if not states:
            return 0.0
        first, last = (TYPES.deserialize_cdr(states[end], JOINT_STATE) for end in (0, -1))
        return seconds_of(last) - seconds_of(first)

    def write(self, folder: Path) -> dict[str, Any] | None:
        """Write the bag `motion` (rosbag2, MCAP) into a folder; gives its figures.

        Returns:
            seconds of the robot's clock, bytes and messages; None, and no bag, if nothing came or
            it was too much.
        """
        if not self._messages or self._bytes > LARGEST:
            return None
        with Writer(folder / MOTION, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
            topics = dict.fromkeys((item.topic, item.kind) for item in self._messages)
            connections = {
                topic: bag.add_connection(topic, kind, typestore=TYPES) for topic, kind in topics
            }
            for item in self._messages:
                bag.write(connections[item.topic], item.stamp, item.data)
        size = sum(file.stat().st_size for file in (folder / MOTION).iterdir())
        return {
            "seconds": round(self._seconds(), 2),
            "bytes": size,
            "messages": len(self._messages),
        }


def seconds_of(state: Any) -> float:
    """When a joint state was measured, seconds of the robot's clock."""
    return float(state.header.stamp.sec + 1e-9 * state.header.stamp.nanosec)
