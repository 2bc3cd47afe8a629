"""The cloth as perception sees it."""

from __future__ import annotations

import threading
from collections import deque

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2

from emd_arm_executor.config import SightConfig
from emd_arm_executor.observed_silhouette import silhouette_from_points
from emd_arm_executor.silhouette import Silhouette
from emd_core.errors import CellError, NoObservationError
from emd_core.ros import conversions
from emd_core.voxel_grid import VoxelGrid
from emd_msgs_py.msg import VoxelGrid as VoxelGridMsg
from emd_msgs_py.srv import CaptureState

# Perception may take all the time that it is given to collect frames, and computes afterwards.
_COMPUTING = 5.0  # seconds
_GRIDS = 5  # of the last observations; the points of the last one may come later than its grid


class ClothSight:
    """Keeps the last points of the cloth and asks for new ones."""

    def __init__(self, node: Node, config: SightConfig, callback_group: CallbackGroup) -> None:
        """Connect `node` with perception; answers are received in `callback_group`."""
        self._node = node
        self._config = config
        self._points: PointCloud2 | None = None
        self._grids: deque[VoxelGridMsg] = deque(maxlen=_GRIDS)
        node.create_subscription(VoxelGridMsg, "perception/voxel_grid", self._on_grid, 5)
        node.create_subscription(PointCloud2, "perception/points", self._on_points, 5)
        self._capture = node.create_client(
            CaptureState, "perception/capture_state", callback_group=callback_group
        )

    def _on_points(self, message: PointCloud2) -> None:
        self._points = message

    def _on_grid(self, message: VoxelGridMsg) -> None:
        self._grids.append(message)

    def latest(self) -> Silhouette:
        """Give the cloth as it was seen last.

        Raises:
            NoObservationError: If it never was.
        """
        if self._points is None:
            raise NoObservationError(
                "no points have come on perception/points yet; capture the cloth first, so that "
                "its hem is known"
            )
        points = conversions.points_from_message(self._points)
        return silhouette_from_points(points, grid=self._grid_of(self._points))

    def _grid_of(self, points: PointCloud2) -> VoxelGrid | None:
        """The grid of the observation that points are of, which tells what was hidden in it."""
        for message in list(self._grids):
            if message.header.stamp == points.header.stamp:
                return conversions.voxel_grid_from_message(message)
        return None

    def look(self) -> Silhouette | None:
        """Capture the cloth now, in a thread that does not spin the node.

        Returns:
            The cloth; None, with a warning unless this is switched off, if perception does not
            say.
        """
        if not self._config.enabled:
            return None
        if not self._capture.service_is_ready():
            self._warn("nobody offers perception/capture_state")
            return None
        try:
            return self._captured()
        except CellError as err:
            self._warn(str(err))
            return None

    def _captured(self) -> Silhouette:
        answered = threading.Event()
        request = CaptureState.Request(frames=self._config.frames, timeout=self._config.timeout)
        future = self._capture.call_async(request)
        future.add_done_callback(lambda _: answered.set())
        patience = self._config.timeout + _COMPUTING
        if not answered.wait(patience):
            future.cancel()
            raise NoObservationError(f"no answer within {patience:.0f} s")
        response = future.result()
        if response.error_code:
            raise NoObservationError(response.error_msg)
        points = conversions.points_from_message(response.points)
        grid = conversions.voxel_grid_from_message(response.voxel_grid)
        return silhouette_from_points(points, grid=grid)

    def _warn(self, reason: str) -> None:
        self._node.get_logger().warning(
            f"nobody has seen whether the cloth came along: {reason}; only the jaws told"
        )
