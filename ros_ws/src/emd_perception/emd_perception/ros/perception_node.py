"""The perception node: a camera's messages in, the cloth's voxel grid out."""

from __future__ import annotations

import sys
import threading
import time
from pathlib import Path

import cv2
from geometry_msgs.msg import PoseStamped
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from emd_core.errors import CellError, InvalidInputError
from emd_core.frames import FieldOfView
from emd_core.ros import conversions
from emd_core.ros.parameters import LiveConfig, declare_config
from emd_core.ros.quality_of_service import LATCHED
from emd_core.ros.results import set_error
from emd_core.ros.spin import spin_node
from emd_core.ros.worker import SingleWorker
from emd_msgs_py.srv import CaptureState
from emd_perception.calibration.calibration import Calibration
from emd_perception.calibration.check import CheckConfig
from emd_perception.config import PerceptionConfig
from emd_perception.frame_input import InputConfig
from emd_perception.health import Health
from emd_perception.perception import Perception
from emd_perception.ros import camera_topics
from emd_perception.ros.frame_buffer import FrameBuffer
from emd_perception.ros.frame_decoder import FrameDecoder
from emd_perception.ros.frame_pair import FramePair
from emd_perception.ros.frame_source import FrameSource
from emd_perception.ros.node_config import AT_START, PerceptionNodeConfig
from emd_perception.ros.perception_publisher import PerceptionPublisher, perception_messages
from emd_perception.session import PerceptionSession
from emd_perception.stream_statistics import StreamStatistics
from emd_perception.table_tracker import TrackerConfig
from emd_perception.table_watch import TableWatch
from emd_perception.warm_up import prepare

_HEALTH_PERIOD = 1.0  # seconds


class PerceptionNode(Node):
    """Streams voxel grids of the newest frames and captures a careful one on request."""

    def __init__(self) -> None:
        """Declare parameters, topics and the capture service."""
        super().__init__("perception")
        self._config = LiveConfig(self, PerceptionNodeConfig(), "node.", self._check_change)
        self._core_config = LiveConfig(self, PerceptionConfig())
        self._field_of_view = LiveConfig(self, FieldOfView(), "field_of_view.")
        source = declare_config(self, InputConfig(), "input.", read_only=True)
        self._session = PerceptionSession(self._make_watch())
        self._camera_pose: PoseStamped | None = None
        self._buffer, self._statistics = FrameBuffer(), StreamStatistics()
        self._decoder = FrameDecoder(source)
        prepare()  # takes a while, in which the first frames would be lost
        self._publisher = PerceptionPublisher(self)
        self.create_subscription(PoseStamped, camera_topics.POSE, self._on_pose, LATCHED)
        start = self._config.value
        self._source = FrameSource(
            self, source, self._on_pair, start.sync_tolerance, start.reliable
        )
        self._worker = SingleWorker(self, "capturing")
        self.create_service(
            CaptureState,
            "perception/capture_state",
            self._on_capture,
            callback_group=self._worker.callback_group,
        )
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(_HEALTH_PERIOD, self._report_health, clock=steady)
        self._stopping = threading.Event()
        self._streamer = threading.Thread(target=self._stream, daemon=True)
        self._streamer.start()

    def destroy_node(self) -> None:
        """Let the frame in work be finished, then the node."""
        self._stopping.set()
        self._streamer.join(timeout=10.0)
        super().destroy_node()

    def _make_watch(self) -> TableWatch:
        file = self._config.value.calibration
        return TableWatch(
            Calibration.load(Path(file)) if file else None,
            declare_config(self, TrackerConfig(), "tracker.", read_only=True),
            declare_config(self, CheckConfig(), "calibration_check.", read_only=True),
        )

    def _check_change(self, wanted: PerceptionNodeConfig) -> None:
        for name in AT_START:
            if getattr(wanted, name) != getattr(self._config.value, name):
                raise InvalidInputError(f"node.{name} is set when the node starts; start it anew")

    def _on_pose(self, message: PoseStamped) -> None:
        self._camera_pose = message

    def _on_pair(self, pair: FramePair) -> None:
        self._statistics.arrived()
        self._buffer.add(pair)

    def _stream(self) -> None:
        """Process the newest pair, again and again; what cannot be served in time is dropped."""
        due = 0.0
        while self.context.ok() and not self._stopping.is_set():
            pair = self._buffer.take(timeout=0.5)
            if pair is None or self._buffer.collecting:
                continue
            started = time.monotonic()
            self._serve(pair, started)
            rate = self._config.value.max_rate
            if rate > 0:  # counted from when it was due: a late frame must not delay all others
                due = max(due, started - 1.0 / rate) + 1.0 / rate
                self._stopping.wait(max(0.0, due - time.monotonic()))

    def _serve(self, pair: FramePair, started: float) -> None:
        complaint = ""
        try:
            perception = self._perceive([pair], streaming=True)
            self._publisher.publish(perception, pair, self._buffer.dropped)
        except CellError as err:
            complaint = str(err)
        except Exception as err:  # a fault of ours must not end the stream
            self.get_logger().error(f"{type(err).__name__}: {err}")
            complaint = repr(err)
        if complaint:
            self._publisher.report_failure(complaint, pair, self._buffer.dropped)
        age = self.get_clock().now().nanoseconds * 1e-9 - pair.stamp
        worked = time.monotonic() - started
        self._statistics.served(age, started - pair.arrival, worked, bool(complaint))

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
            request.frames or self._config.value.capture_frames,
            since=self.get_clock().now().nanoseconds * 1e-9,
            timeout=request.timeout or self._config.value.capture_timeout,
        )
        perception = self._perceive(pairs)
        self._publisher.publish(perception, pairs[-1], self._buffer.dropped)
        messages = perception_messages(perception, pairs[-1])
        response.voxel_grid, response.mask = messages.grid, messages.mask
        response.points = messages.points
        response.table_plane = [float(value) for value in perception.table_plane]
        response.quality, response.reason = perception.quality, perception.reason
        return response

    def _perceive(self, pairs: list[FramePair], streaming: bool = False) -> Perception:
        pose = self._camera_pose
        return self._session.perceive(
            [
                self._decoder.decode(pair.colour, pair.depth, pair.info, pair.depth_info)
                for pair in pairs
            ],
            None if pose is None else conversions.transform_from_pose_message(pose.pose),
            pairs[-1].stamp,
            self._core_config.value,
            self._field_of_view.value,
            streaming,
        )

    def _report_health(self) -> None:
        camera = self._source.health(self._config.value.camera_timeout)
        figures = {
            **camera.values,
            **self._statistics.figures(),
            "frames_dropped": str(self._buffer.dropped),
        }
        reports = [
            Health(camera.part, camera.level, camera.text, figures),
            *self._session.watch.health(),
        ]
        self._publisher.report_health(reports, self.get_clock().now().to_msg())


def main() -> int:
    """Run the node until interrupted."""
    cv2.setNumThreads(1)  # for pictures of this size threads take more time than they save
    return spin_node(PerceptionNode)


if __name__ == "__main__":
    sys.exit(main())
