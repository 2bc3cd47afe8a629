"""Listens to a camera, pairs its messages, and tells what is missing."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, Image

from emd_core.pair_matcher import PairMatcher
from emd_core.ros import conversions
from emd_perception.frame_input import DepthSource, InputConfig
from emd_perception.health import Health, Level
from emd_perception.ros import camera_topics
from emd_perception.ros.frame_pair import FramePair

_BACKWARDS = 1.0  # seconds; stamps may be a little out of order


class FrameSource:
    """The subscriptions to one camera.

    Attributes:
        clock_jumps: How often the stamps went back.
    """

    def __init__(
        self,
        node: Node,
        config: InputConfig,
        on_pair: Callable[[FramePair], None],
        tolerance: float,
        reliable: bool = False,
    ) -> None:
        """Subscribe.

        Args:
            node: Whose subscriptions these are.
            config: What the camera gives.
            on_pair: Called with each pair.
            tolerance: Largest difference of the stamps of colour and depth, seconds.
            reliable: Whether lost messages are asked for again; else any camera driver will do.
        """
        self._on_pair, self._tolerance = on_pair, tolerance
        self._pairs = self._matcher()
        self._infos: dict[str, Any] = {"info": None, "depth_info": None}
        self._last_arrival: dict[str, float] = {}
        self._last_pair = self._started = time.monotonic()
        self._last_stamp: dict[str, float] = {}
        self._given_up = 0
        self.clock_jumps = 0
        depth_topic, depth_type = camera_topics.DEPTH[config.source]
        sensor = QoSProfile(depth=5) if reliable else qos_profile_sensor_data
        # Before the images: of several messages that wait, those of the first subscription are
        # handled first, so an image never meets a calibration older than itself.
        infos = {"info": camera_topics.INFO}
        if config.source is DepthSource.UNREGISTERED:
            infos["depth_info"] = camera_topics.DEPTH_INFO
        for kind, topic in infos.items():
            node.create_subscription(CameraInfo, topic, partial(self._on_info, kind), sensor)
        for kind, message_type, topic in (
            ("colour", Image, camera_topics.COLOUR),
            ("depth", depth_type, depth_topic),
        ):
            node.create_subscription(message_type, topic, partial(self._on_image, kind), sensor)

    @property
    def unpaired(self) -> int:
        """Images without a partner so far."""
        return self._given_up + self._pairs.unpaired

    def health(self, timeout: float) -> Health:
        """Say whether the camera is there; silence of `timeout` seconds is a loss."""
        now = time.monotonic()
        values = {"unpaired": str(self.unpaired), "clock_jumps": str(self.clock_jumps)}
        if now - self._last_pair <= timeout and self._last_pair > self._started:
            return Health("camera", Level.OK, "colour and depth come", values)
        silent = {
            kind: now - self._last_arrival.get(kind, self._started) for kind in ("colour", "depth")
        }
        missing = [f"no {kind} for {gap:.1f} s" for kind, gap in silent.items() if gap > timeout]
        if missing:
            text = f"{' and '.join(missing)}; is the camera on, do topics and QoS match?"
            return Health("camera", Level.ERROR, text, values)
        if now - self._started <= timeout:
            return Health("camera", Level.WARN, "waiting for the first pair of images", values)
        text = (
            f"colour and depth come, but their stamps differ by more than {self._tolerance:g} s; "
            "are both of the same clock?"
        )
        return Health("camera", Level.ERROR, text, values)

    def _matcher(self) -> PairMatcher[Any]:
        return PairMatcher(("colour", "depth"), self._tolerance)

    def _on_info(self, kind: str, message: CameraInfo) -> None:
        self._infos[kind] = message

    def _on_image(self, kind: str, message: Any) -> None:
        stamp = conversions.time_from_message(message.header.stamp)
        self._last_arrival[kind] = time.monotonic()
        if stamp < self._last_stamp.get(kind, stamp) - _BACKWARDS:
            self._start_anew()
        self._last_stamp[kind] = stamp
        pair = self._pairs.add(kind, stamp, message)
        if pair is not None:
            self._last_pair = time.monotonic()
            self._on_pair(FramePair(*pair, self._infos["info"], self._infos["depth_info"]))

    def _start_anew(self) -> None:
        """The clock went back: nothing that waits will get a partner any more."""
        self.clock_jumps += 1
        self._given_up = self.unpaired + self._pairs.waiting
        self._pairs = self._matcher()
        self._last_stamp.clear()
