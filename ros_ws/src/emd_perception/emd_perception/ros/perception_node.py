"""The perception node: colour and depth images in, the cloth's voxel grid out."""

from __future__ import annotations

import sys
import threading
import time
from dataclasses import dataclass
from functools import partial
from typing import Any

from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, Image

from emd_core.errors import CellError, NoObservationError
from emd_core.frames import FieldOfView
from emd_core.pair_matcher import PairMatcher
from emd_core.ros import conversions
from emd_core.ros.parameters import declare_config
from emd_core.ros.quality_of_service import LATCHED
from emd_core.ros.results import set_error
from emd_core.ros.spin import spin_node
from emd_core.ros.worker import SingleWorker
from emd_msgs_py.srv import CaptureState
from emd_perception.config import PerceptionConfig
from emd_perception.depth_image import depth_in_metres
from emd_perception.open3d_library import load_open3d
from emd_perception.pipeline import Perception, perceive_frames
from emd_perception.ros.frame_buffer import FrameBuffer
from emd_perception.ros.frame_pair import FramePair
from emd_perception.ros.perception_publisher import PerceptionPublisher, perception_messages


@dataclass(frozen=True)
class PerceptionNodeConfig:
    """How the node takes frames.

    Attributes:
        max_rate: Frames processed a second at most while streaming; 0: as many as it can.
        reliable: Whether lost images are sent again. Without, any camera driver will do, but on a
            busy machine images are lost: one is larger than Fast DDS's shared memory.
        sync_tolerance: Largest difference of the stamps of colour and depth, seconds.
        capture_frames: Depth frames that a capture fuses unless the request says otherwise.
        capture_timeout: Seconds that a capture waits for them unless the request says otherwise.
    """

    max_rate: float = 5.0
    reliable: bool = False
    sync_tolerance: float = 0.02
    capture_frames: int = 10
    capture_timeout: float = 40.0


class PerceptionNode(Node):
    """Streams voxel grids of the newest frames and captures a careful one on request."""

    def __init__(self) -> None:
        """Declare parameters, topics and the capture service."""
        super().__init__("perception")
        self._config = declare_config(self, PerceptionNodeConfig(), "node.")
        self._core_config = declare_config(self, PerceptionConfig())
        self._field_of_view = declare_config(self, FieldOfView(), "field_of_view.")
        self._pairs = PairMatcher[Image](("colour", "depth"), self._config.sync_tolerance)
        self._camera: Any = None
        self._camera_pose: PoseStamped | None = None
        self._buffer = FrameBuffer()
        load_open3d()  # takes a second, in which the first frames would be lost
        self._subscribe()
        self._publisher = PerceptionPublisher(self)
        self._worker = SingleWorker(self, "capturing")
        self.create_service(
            CaptureState,
            "perception/capture_state",
            self._on_capture,
            callback_group=self._worker.callback_group,
        )
        threading.Thread(target=self._stream, daemon=True).start()

    def _subscribe(self) -> None:
        sensor = QoSProfile(depth=5) if self._config.reliable else qos_profile_sensor_data
        # Before the images: of several messages that wait, those of the first subscription are
        # handled first, so an image never meets a calibration older than itself.
        self.create_subscription(CameraInfo, "camera/color/camera_info", self._on_info, sensor)
        self.create_subscription(PoseStamped, "camera/pose", self._on_pose, LATCHED)
        for kind, topic in (
            ("colour", "camera/color/image_raw"),
            ("depth", "camera/depth_registered/image_raw"),
        ):
            self.create_subscription(Image, topic, partial(self._on_image, kind), sensor)

    def _on_info(self, message: CameraInfo) -> None:
        self._camera = message

    def _on_pose(self, message: PoseStamped) -> None:
        self._camera_pose = message

    def _on_image(self, kind: str, message: Image) -> None:
        stamp = conversions.time_from_message(message.header.stamp)
        pair = self._pairs.add(kind, stamp, message)
        if pair is not None:
            self._buffer.add(FramePair(*pair))

    def _stream(self) -> None:
        """Process the newest pair, again and again; what cannot be served in time is dropped."""
        while self.context.ok():
            pair = self._buffer.take(timeout=0.5)
            if pair is None or self._buffer.collecting:
                continue
            started = time.monotonic()
            try:
                self._publisher.publish(self._perceive([pair]), pair, self._buffer.dropped)
            except CellError as err:
                self._publisher.report_failure(str(err), pair, self._buffer.dropped)
            except Exception as err:  # a fault of ours must not end the stream
                self.get_logger().error(f"{type(err).__name__}: {err}")
                self._publisher.report_failure(repr(err), pair, self._buffer.dropped)
            if self._config.max_rate > 0:
                time.sleep(max(0.0, started + 1.0 / self._config.max_rate - time.monotonic()))

    async def _on_capture(
        self, request: CaptureState.Request, response: CaptureState.Response
    ) -> CaptureState.Response:
        try:
            return await self._worker.run(lambda: self._capture(request, response))
        except Exception as err:
            return set_error(response, err, self)  # type: ignore[no-any-return]

    def _capture(
        self, request: CaptureState.Request, response: CaptureState.Response
    ) -> CaptureState.Response:
        pairs = self._buffer.collect(
            request.frames or self._config.capture_frames,
            since=self.get_clock().now().nanoseconds * 1e-9,
            timeout=request.timeout or self._config.capture_timeout,
        )
        perception = self._perceive(pairs)
        self._publisher.publish(perception, pairs[-1], self._buffer.dropped)
        messages = perception_messages(perception, pairs[-1])
        response.voxel_grid, response.mask = messages.grid, messages.mask
        response.points = messages.points
        response.table_plane = [float(value) for value in perception.table_plane]
        response.quality, response.reason = perception.quality, perception.reason
        return response

    def _perceive(self, pairs: list[FramePair]) -> Perception:
        if self._camera is None:
            raise NoObservationError(
                "images came, but no calibration on camera/color/camera_info; publish it"
            )
        pose = self._camera_pose
        return perceive_frames(
            [conversions.rgb_from_message(pair.colour) for pair in pairs],
            [
                depth_in_metres(
                    conversions.image_from_message(pair.depth), encoding=pair.depth.encoding
                )
                for pair in pairs
            ],
            conversions.camera_from_message(self._camera),
            None if pose is None else conversions.transform_from_pose_message(pose.pose),
            self._core_config,
            # Without a pose there is no cell to keep to: the field of view may grow to the cloth.
            None if pose is None else self._field_of_view,
        )


def main() -> int:
    """Run the node until interrupted."""
    return spin_node(PerceptionNode)


if __name__ == "__main__":
    sys.exit(main())
