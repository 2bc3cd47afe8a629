"""The perception node: colour and depth images in, the cloth's voxel grid out."""

from __future__ import annotations

import sys
import threading
import time
from dataclasses import dataclass
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from std_msgs.msg import Header
from visualization_msgs.msg import MarkerArray

from emd_core.errors import CellError, NoObservationError
from emd_core.frames import FieldOfView
from emd_core.ros import conversions
from emd_core.ros.markers import voxel_marker
from emd_core.ros.parameters import declare_config
from emd_core.ros.results import set_error
from emd_core.ros.spin import spin_node
from emd_core.ros.worker import SingleWorker
from emd_msgs_py.msg import VoxelGrid as VoxelGridMsg
from emd_msgs_py.srv import CaptureState
from emd_perception.config import PerceptionConfig
from emd_perception.depth_image import depth_in_metres
from emd_perception.open3d_library import load_open3d
from emd_perception.pipeline import Perception, perceive_frames
from emd_perception.ros.frame_buffer import FrameBuffer
from emd_perception.ros.frame_pairs import FramePair, FramePairs


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
        self._pairs = FramePairs(self._config.sync_tolerance)
        self._camera: Any = None
        self._camera_pose: PoseStamped | None = None
        self._buffer = FrameBuffer()
        load_open3d()  # takes a second, in which the first frames would be lost
        self._subscribe()
        self._grid_publisher = self.create_publisher(VoxelGridMsg, "perception/voxel_grid", 5)
        self._mask_publisher = self.create_publisher(Image, "perception/mask", 5)
        self._points_publisher = self.create_publisher(PointCloud2, "perception/points", 5)
        self._markers_publisher = self.create_publisher(MarkerArray, "perception/markers", 5)
        self._diagnostics_publisher = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._worker = SingleWorker(self, "capturing")
        self.create_service(
            CaptureState,
            "perception/capture_state",
            self._on_capture,
            callback_group=self._worker.callback_group,
        )
        threading.Thread(target=self._stream, daemon=True).start()

    def _subscribe(self) -> None:
        latched = QoSProfile(
            depth=1,
            reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL,
        )
        sensor = QoSProfile(depth=5) if self._config.reliable else qos_profile_sensor_data
        # Before the images: of several messages that wait, those of the first subscription are
        # handled first, so an image never meets a calibration older than itself.
        self.create_subscription(CameraInfo, "camera/color/camera_info", self._on_info, sensor)
        self.create_subscription(PoseStamped, "camera/pose", self._on_pose, latched)
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
        pair = self._pairs.add(kind, message)
        if pair is not None:
            self._buffer.add(pair)

    def _stream(self) -> None:
        """Process the newest pair, again and again; what cannot be served in time is dropped."""
        while self.context.ok():
            pair = self._buffer.take(timeout=0.5)
            if pair is None or self._buffer.collecting:
                continue
            started = time.monotonic()
            try:
                self._publish(self._perceive([pair]), pair)
            except CellError as err:
                self._report(pair, DiagnosticStatus.ERROR, str(err), {"grid": "no"})
            except Exception as err:  # a fault of ours must not end the stream
                self.get_logger().error(f"{type(err).__name__}: {err}")
                self._report(pair, DiagnosticStatus.ERROR, repr(err), {"grid": "no"})
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
        self._publish(perception, pairs[-1])
        header = self._table_header(pairs[-1])
        response.voxel_grid = conversions.voxel_grid_to_message(perception.voxel_grid, header)
        response.mask = self._mask_message(perception, pairs[-1])
        response.points = conversions.points_to_message(perception.points_in_table, header)
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

    def _publish(self, perception: Perception, pair: FramePair) -> None:
        header = self._table_header(pair)
        grid = perception.voxel_grid
        self._grid_publisher.publish(conversions.voxel_grid_to_message(grid, header))
        self._mask_publisher.publish(self._mask_message(perception, pair))
        points = conversions.points_to_message(perception.points_in_table, header)
        self._points_publisher.publish(points)
        self._markers_publisher.publish(
            MarkerArray(markers=[voxel_marker(grid, header, "perceived")])
        )
        level = DiagnosticStatus.OK if perception.quality >= 0.5 else DiagnosticStatus.WARN
        values = {
            "grid": "yes",
            "quality": f"{perception.quality:.3f}",
            "cloth_pixels": str(int(perception.mask.sum())),
            "occupied_voxels": str(int(grid.occupancy.sum())),
            **{f"ms_{name}": f"{value:.1f}" for name, value in perception.milliseconds.items()},
        }
        self._report(pair, level, perception.reason, values)

    def _report(self, pair: FramePair, level: bytes, text: str, values: dict[str, str]) -> None:
        """Say on /diagnostics what became of a pair; stamped like its colour image."""
        values = {"frames_dropped": str(self._buffer.dropped), **values}
        status = DiagnosticStatus(
            level=level,
            name="perception: cloth",
            message=text,
            hardware_id=self.get_fully_qualified_name(),
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )
        message = DiagnosticArray(header=self._table_header(pair), status=[status])
        self._diagnostics_publisher.publish(message)

    def _table_header(self, pair: FramePair) -> Header:
        return conversions.header(pair.colour.header.stamp, conversions.TABLE_FRAME)

    def _mask_message(self, perception: Perception, pair: FramePair) -> Image:
        mask = perception.mask.astype("uint8") * 255
        return conversions.image_to_message(mask, "mono8", pair.colour.header)


def main() -> int:
    """Run the node until interrupted."""
    return spin_node(PerceptionNode)


if __name__ == "__main__":
    sys.exit(main())
