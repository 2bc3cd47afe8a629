"""Shows frames to a perception node and waits for its answers."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from numpy.typing import NDArray
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, Image

from emd_cell.bag_reader import BagMessage
from emd_core.errors import DeadlineError
from emd_core.ros import conversions
from emd_core.ros.quality_of_service import LATCHED
from emd_core.voxel_grid import VoxelGrid
from emd_msgs_py.msg import VoxelGrid as VoxelGridMsg
from emd_perception.frame_input import DepthSource, InputConfig
from emd_perception.ros import camera_topics
from emd_perception.ros.perception_publisher import CLOTH

NAMESPACE = "/replay"  # keeps the replay apart from a live cell
CALIBRATIONS = ("info", "depth_info", "pose")
_RESEND = 5.0  # seconds; an image may be lost on its way
_AFTER_STAMP = 12  # bytes of a serialised message: 4 of encapsulation, then the header's stamp


@dataclass(frozen=True)
class Answer:
    """What perception says to a pair: its verdict, and grid and mask if it found cloth."""

    verdict: dict[str, str]
    grid: VoxelGrid | None = None
    mask: NDArray[np.bool_] | None = None


class ReplayClient(Node):
    """Publishes one pair of images at a time and waits for the answer to it."""

    def __init__(self, config: InputConfig) -> None:
        """Make the publishers and subscriptions in the replay's own namespace."""
        super().__init__(
            "replay", namespace=NAMESPACE, start_parameter_services=False, enable_rosout=False
        )
        depth_topic, depth_type = camera_topics.DEPTH[config.source]
        # An executor waits for all handlers of events in each turn, and here nobody needs them.
        no_events = PublisherEventCallbacks(use_default_callbacks=False)
        advertise = partial(self.create_publisher, event_callbacks=no_events)
        self._publishers_by_kind = {
            "color": advertise(Image, camera_topics.COLOUR, 5),
            "depth": advertise(depth_type, depth_topic, 5),
            "info": advertise(CameraInfo, camera_topics.INFO, 5),
            "pose": advertise(PoseStamped, camera_topics.POSE, LATCHED),
        }
        if config.source is DepthSource.UNREGISTERED:
            self._publishers_by_kind["depth_info"] = advertise(
                CameraInfo, camera_topics.DEPTH_INFO, 5
            )
        self._known: dict[str, BagMessage] = {}
        self._told: dict[str, bytes] = {}
        self._grids: dict[int, VoxelGrid] = {}
        self._masks: dict[int, NDArray[np.bool_]] = {}
        self._verdicts: dict[int, dict[str, str]] = {}
        listen = partial(
            self.create_subscription,
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
        )
        listen(VoxelGridMsg, "perception/voxel_grid", self._on_grid, 5)
        listen(Image, "perception/mask", self._on_mask, 5)
        listen(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)
        self._spinner = SingleThreadedExecutor()
        self._spinner.add_node(self)

    def wait_for_perception(self, timeout: float, check: Callable[[], None]) -> None:
        """Wait until the perception node listens to the images.

        Raises:
            DeadlineError: If it does not within `timeout` seconds.
        """
        deadline = time.monotonic() + timeout
        publishers = self._publishers_by_kind.values()
        while unheard := [p.topic_name for p in publishers if p.get_subscription_count() == 0]:
            check()
            if time.monotonic() > deadline:
                raise DeadlineError(
                    f"the perception node did not appear within {timeout:.0f} s: nobody listens "
                    f"to {', '.join(unheard)}; start the replay again"
                )
            self._spinner.spin_once(timeout_sec=0.05)
        # That side may know of its readers a little later than this one knows of them.
        settled = time.monotonic() + 1.0
        while time.monotonic() < settled:
            self._spinner.spin_once(timeout_sec=0.05)

    def remember(self, message: BagMessage) -> None:
        """Keep a calibration or pose; it is sent with the next pair if it says something new."""
        if message.kind in self._publishers_by_kind:
            self._known[message.kind] = message

    def play_pair(
        self,
        color: BagMessage,
        depth: BagMessage,
        check: Callable[[], None],
        timeout: float = 60.0,
    ) -> Answer:
        """Send a pair and wait for perception's verdict, and for grid and mask if there are.

        Args:
            color: The colour image.
            depth: Its depth.
            check: Called while waiting; raises if perception is gone.
            timeout: Seconds.

        Raises:
            DeadlineError: If perception says nothing about the pair.
        """
        deadline = time.monotonic() + timeout
        resend = 0.0
        while not self._answered(color.stamp):
            if time.monotonic() > deadline:
                raise DeadlineError(f"perception did not answer within {timeout:.0f} s")
            if time.monotonic() > resend:  # images are sent best effort
                check()
                if resend > 0.0:
                    self._told.clear()
                self._send(color, depth)
                resend = time.monotonic() + _RESEND
            self._spinner.spin_once(timeout_sec=0.2)
        answer = Answer(
            self._verdicts[color.stamp],
            self._grids.get(color.stamp),
            self._masks.get(color.stamp),
        )
        for answers in (self._verdicts, self._grids, self._masks):
            answers.clear()  # also late ones to earlier pairs
        return answer

    def _send(self, *images: BagMessage) -> None:
        """Send images as they were recorded, before them what was not told yet."""
        for kind, message in self._known.items():
            content = message.data[_AFTER_STAMP:]
            if self._told.get(kind) != content:
                self._told[kind] = content
                self._publishers_by_kind[kind].publish(message.data)
        for message in images:
            self._publishers_by_kind[message.kind].publish(message.data)

    def _answered(self, stamp: int) -> bool:
        verdict = self._verdicts.get(stamp)
        complete = stamp in self._grids and stamp in self._masks
        return verdict is not None and (verdict["grid"] == "no" or complete)

    def _on_grid(self, message: VoxelGridMsg) -> None:
        self._grids[_nanoseconds(message)] = conversions.voxel_grid_from_message(message)

    def _on_mask(self, message: Image) -> None:
        self._masks[_nanoseconds(message)] = conversions.image_from_message(message) > 0

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.hardware_id == f"{NAMESPACE}/perception" and status.name == CLOTH:
                values = {item.key: item.value for item in status.values}
                self._verdicts[_nanoseconds(message)] = {**values, "reason": status.message}


def _nanoseconds(message: Any) -> int:
    return int(message.header.stamp.sec) * 1_000_000_000 + int(message.header.stamp.nanosec)
