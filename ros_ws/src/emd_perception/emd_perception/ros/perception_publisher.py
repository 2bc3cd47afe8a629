"""What perception publishes: grid, mask, points, markers and diagnostics."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from sensor_msgs.msg import Image, PointCloud2
from std_msgs.msg import Header
from visualization_msgs.msg import MarkerArray

from emd_core.ros import conversions
from emd_core.ros.markers import voxel_marker
from emd_msgs_py.msg import VoxelGrid as VoxelGridMsg
from emd_perception.health import Health
from emd_perception.pipeline import Perception
from emd_perception.ros.frame_pair import FramePair


@dataclass(frozen=True)
class PerceptionMessages:
    """Messages of one perception: grid and points in the table frame, mask in the image."""

    grid: Any
    mask: Any
    points: Any


def perception_messages(perception: Perception, pair: FramePair) -> PerceptionMessages:
    """Turn what was perceived in `pair` into messages with the stamp of its colour image."""
    return PerceptionMessages(
        _grid_message(perception, pair),
        _mask_message(perception, pair),
        _points_message(perception, pair),
    )


def _grid_message(perception: Perception, pair: FramePair) -> Any:
    return conversions.voxel_grid_to_message(perception.voxel_grid, _table_header(pair))


def _mask_message(perception: Perception, pair: FramePair) -> Any:
    mask = perception.mask.view(np.uint8) * np.uint8(255)
    return conversions.image_to_message(mask, "mono8", pair.colour.header)


def _points_message(perception: Perception, pair: FramePair) -> Any:
    return conversions.points_to_message(perception.points_in_table, _table_header(pair))


def _marker_message(perception: Perception, pair: FramePair) -> Any:
    marker = voxel_marker(perception.voxel_grid, _table_header(pair), "perceived")
    return MarkerArray(markers=[marker])


CLOTH = "perception: cloth"
"""Name of the diagnostic status that says what became of each pair of images."""


class PerceptionPublisher:
    """Publishes a perception, or why there is none, and how perception itself is."""

    def __init__(self, node: Node) -> None:
        """Advertise the topics."""
        self._name = node.get_fully_qualified_name()
        # An executor waits for all handlers of events in each turn; subscribers warn of QoS too.
        no_events = PublisherEventCallbacks(use_default_callbacks=False)
        advertise = partial(node.create_publisher, event_callbacks=no_events)
        self._grid = advertise(VoxelGridMsg, "perception/voxel_grid", 5)
        self._mask = advertise(Image, "perception/mask", 5)
        self._points = advertise(PointCloud2, "perception/points", 5)
        self._markers = advertise(MarkerArray, "perception/markers", 5)
        self._diagnostics = advertise(DiagnosticArray, "/diagnostics", 10)

    def publish(self, perception: Perception, pair: FramePair, dropped: int) -> None:
        """Publish everything about `pair` that somebody listens to.

        Args:
            perception: What was seen.
            pair: In which images.
            dropped: Frames that were left out so far.
        """
        for publisher, make in (
            (self._grid, _grid_message),
            (self._mask, _mask_message),
            (self._points, _points_message),
            (self._markers, _marker_message),
        ):
            if publisher.get_subscription_count() > 0:
                publisher.publish(make(perception, pair))
        grid = perception.voxel_grid
        level = DiagnosticStatus.OK if perception.quality >= 0.5 else DiagnosticStatus.WARN
        values = {
            "grid": "yes",
            "frames_dropped": str(dropped),
            "quality": f"{perception.quality:.3f}",
            "cloth_pixels": str(np.count_nonzero(perception.mask)),
            "occupied_voxels": str(np.count_nonzero(grid.occupancy)),
            "unknown_columns": str(grid.unknown_count),
            "outline_uses": str(perception.memory.uses if perception.memory else 0),
            **{f"ms_{name}": f"{value:.1f}" for name, value in perception.milliseconds.items()},
        }
        self._report(pair, level, perception.reason, values)

    def report_failure(self, reason: str, pair: FramePair, dropped: int) -> None:
        """Say why `pair` gave no grid."""
        values = {"grid": "no", "frames_dropped": str(dropped)}
        self._report(pair, DiagnosticStatus.ERROR, reason, values)

    def report_health(self, reports: list[Health], stamp: Any) -> None:
        """Say on /diagnostics how the parts of perception are."""
        status = [
            DiagnosticStatus(
                level=bytes([one.level]),
                name=f"perception: {one.part}",
                message=one.text,
                hardware_id=self._name,
                values=[KeyValue(key=key, value=value) for key, value in one.values.items()],
            )
            for one in reports
        ]
        table = conversions.header(stamp, conversions.TABLE_FRAME)
        self._diagnostics.publish(DiagnosticArray(header=table, status=status))

    def _report(self, pair: FramePair, level: bytes, text: str, values: dict[str, str]) -> None:
        """Say on /diagnostics what became of a pair; stamped like its colour image."""
        status = DiagnosticStatus(
            level=level,
            name=CLOTH,
            message=text,
            hardware_id=self._name,
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )
        self._diagnostics.publish(DiagnosticArray(header=_table_header(pair), status=[status]))


def _table_header(pair: FramePair) -> Header:
    return conversions.header(pair.colour.header.stamp, conversions.TABLE_FRAME)
