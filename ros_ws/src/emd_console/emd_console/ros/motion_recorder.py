"""Hears what belongs to a motion and keeps it while one is carried out."""

from __future__ import annotations

import threading
from functools import partial
from typing import Any

from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from emd_console.motion import (
    CAMERA_POSE,
    DESCRIPTION,
    JOINT_STATE,
    JOINTS,
    POSE,
    STRING,
    TRAJECTORY,
    MotionLog,
    MotionMessage,
)
from emd_console.ros.cell_view import EXECUTE_ACTION
from emd_core.ros.quality_of_service import LATCHED
from emd_msgs_py.action import ExecuteManipulation

_LOOK_PERIOD = 2.0  # seconds between looks for trajectory topics
_TRAJECTORIES = "/joint_trajectory"


class MotionRecorder:
    """Joint states, trajectories of all controllers, phases; description and camera's pose.

    Messages are kept as they came, without being decoded. Controllers are found by the type of
    their topic, so that any robot's are recorded.
    """

    def __init__(self, node: Node) -> None:
        """Listen through `node`, which the caller spins."""
        self._node = node
        self._lock = threading.Lock()
        self._log: MotionLog | None = None
        self._latest: dict[str, MotionMessage] = {}
        self._heard: set[str] = set()
        states = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._listen(JointState, JOINTS.lstrip("/"), JOINT_STATE, states)
        self._listen(String, DESCRIPTION.lstrip("/"), STRING, LATCHED)
        self._listen(PoseStamped, CAMERA_POSE.lstrip("/"), POSE, LATCHED)
        feedback: Any = ExecuteManipulation.Impl.FeedbackMessage
        topic = f"{EXECUTE_ACTION}/_action/feedback"
        node.create_subscription(feedback, topic, self._on_feedback, 10)
        self._timer = node.create_timer(_LOOK_PERIOD, self._find_controllers)

    def start(self) -> None:
        """Keep what comes from now on, and what was latched before."""
        with self._lock:
            self._log = MotionLog()
            now = self._now()
            for item in self._latest.values():
                self._log.add(MotionMessage(item.topic, item.kind, now, item.data))

    def finish(self) -> MotionLog | None:
        """Give what came since the start."""
        with self._lock:
            log, self._log = self._log, None
        return log

    def _listen(self, message: Any, topic: str, kind: str, quality: QoSProfile) -> None:
        self._heard.add(topic)
        take = partial(self._take, f"/{topic.lstrip('/')}", kind, quality is LATCHED)
        self._node.create_subscription(message, topic, take, quality, raw=True)

    def _find_controllers(self) -> None:
        for topic, kinds in self._node.get_topic_names_and_types():
            if topic.endswith(_TRAJECTORIES) and TRAJECTORY in kinds and topic not in self._heard:
                self._listen(JointTrajectory, topic, TRAJECTORY, QoSProfile(depth=20))

    def _take(self, topic: str, kind: str, latched: bool, data: bytes) -> None:
        message = MotionMessage(topic, kind, self._now(), data)
        with self._lock:
            if latched:
                self._latest[topic] = message
            if self._log is not None:
                self._log.add(message)

    def _on_feedback(self, message: Any) -> None:
        with self._lock:
            if self._log is not None:
                self._log.enter(message.feedback.phase, self._now())

    def _now(self) -> int:
        return int(self._node.get_clock().now().nanoseconds)
