"""Everything that the console hears of a cell, kept as the newest state."""

from __future__ import annotations

import threading
import time
from functools import partial
from typing import Any

import numpy as np
from action_msgs.msg import GoalStatus, GoalStatusArray
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from numpy.typing import NDArray
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import CameraInfo, Image, JointState, PointCloud2
from std_msgs.msg import String

from emd_console.cell_state import CellState
from emd_console.health import report_from_status
from emd_console.outline import mask_outlines
from emd_console.robot_view import RobotView
from emd_core.errors import CellError
from emd_core.ros import conversions
from emd_core.ros.quality_of_service import LATCHED
from emd_msgs_py.action import ExecuteManipulation, PlanFold
from emd_msgs_py.msg import VoxelGrid as VoxelGridMsg

PLAN_ACTION = "planner/plan_fold"
EXECUTE_ACTION = "arm_executor/execute_manipulation"
_ACTIVE = (
    GoalStatus.STATUS_ACCEPTED,
    GoalStatus.STATUS_EXECUTING,
    GoalStatus.STATUS_CANCELING,
)


class CellView:
    """Subscribes to image, mask, grids, plans, motions, joints and diagnostics of a cell.

    Goals of other clients are heard too, since actions publish their feedback. Camera images stay
    as they came until somebody wants to see one.
    """

    def __init__(self, node: Node, state: CellState, reliable: bool = False) -> None:
        """Listen through `node` and keep what comes in `state`.

        Args:
            node: Spun by the caller.
            state: Updated by the callbacks.
            reliable: Whether lost images are asked for again, which publishers must offer.
        """
        self._node = node
        self.state = state
        self._lock = threading.Lock()
        self._raw_image: bytes | None = None
        self._image_number = 0
        reliability = ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT
        sensor = QoSProfile(depth=2, reliability=reliability)
        self._subscribe(sensor)
        self._follow_actions()

    @property
    def image_number(self) -> int:
        """How many camera images have come."""
        return self._image_number

    def image(self) -> NDArray[np.uint8] | None:
        """The newest camera image as RGB, shape (H, W, 3); None if none can be read."""
        with self._lock:
            raw = self._raw_image
        if raw is None:
            return None
        try:
            return conversions.rgb_from_message(deserialize_message(raw, Image))
        except CellError as err:
            self._complain(err)
            return None

    def _subscribe(self, sensor: QoSProfile) -> None:
        listen = self._node.create_subscription
        listen(Image, "camera/color/image_raw", self._on_image, sensor, raw=True)
        listen(CameraInfo, "camera/color/camera_info", self._safely(self._on_info), sensor)
        listen(PoseStamped, "camera/pose", self._safely(self._on_pose), LATCHED)
        listen(Image, "perception/mask", self._safely(self._on_mask), sensor)
        for topic, part in (("perception", "grid"), ("simulation", "truth")):
            take = self._safely(partial(self._on_grid, part))
            listen(VoxelGridMsg, f"{topic}/voxel_grid", take, sensor)
        listen(PointCloud2, "simulation/cloth", self._safely(self._on_cloth), sensor)
        listen(JointState, "joint_states", self._safely(self._on_joints), sensor)
        listen(String, "robot_description", self._safely(self._on_description), LATCHED)
        listen(DiagnosticArray, "/diagnostics", self._safely(self._on_diagnostics), 10)

    def _follow_actions(self) -> None:
        listen = self._node.create_subscription
        for name, kind, take, part in (
            (PLAN_ACTION, PlanFold, self._on_search, "planning"),
            (EXECUTE_ACTION, ExecuteManipulation, self._on_motion, "moving"),
        ):
            feedback: Any = kind.Impl.FeedbackMessage
            listen(feedback, f"{name}/_action/feedback", self._safely(take), 10)
            status = partial(self._on_status, part)
            listen(GoalStatusArray, f"{name}/_action/status", self._safely(status), LATCHED)

    def _safely(self, take: Any) -> Any:
        """Let a malformed message cost no more than itself."""

        def taken(message: Any) -> None:
            try:
                take(message)
            except (CellError, ValueError) as err:
                self._complain(err)

        return taken

    def _complain(self, err: Exception) -> None:
        self._node.get_logger().warning(str(err), throttle_duration_sec=5.0)

    def _on_image(self, raw: bytes) -> None:
        with self._lock:
            self._raw_image = raw
        self._image_number += 1

    def _on_info(self, message: CameraInfo) -> None:
        self.state.update(camera=conversions.camera_from_message(message))

    def _on_pose(self, message: PoseStamped) -> None:
        transform = conversions.transform_from_pose_message(message.pose)
        self.state.update(transform_camera_to_table=transform)

    def _on_mask(self, message: Image) -> None:
        mask = conversions.image_from_message(message)
        self.state.update(outlines=tuple(mask_outlines(np.ascontiguousarray(mask))))

    def _on_grid(self, part: str, message: VoxelGridMsg) -> None:
        self.state.update(**{part: conversions.voxel_grid_from_message(message)})

    def _on_cloth(self, message: PointCloud2) -> None:
        self.state.update(cloth_states=conversions.points_from_message(message))

    def _on_joints(self, message: JointState) -> None:
        self.state.update(joints=dict(zip(message.name, message.position, strict=False)))

    def _on_description(self, message: String) -> None:
        self.state.update(robot=RobotView(message.data))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        now = time.monotonic()
        for status in message.status:
            level = int.from_bytes(status.level, "little")
            self.state.report(
                report_from_status(status.name, level, status.message, status.hardware_id, now)
            )

    def _on_search(self, message: Any) -> None:
        feedback = message.feedback
        best = tuple(
            conversions.manipulation_from_message(item)
            for item in feedback.best_plan.manipulations
        )
        goal = bytes(bytearray(message.goal_id.uuid))
        self.state.search_feedback(goal, feedback.iteration, feedback.best_loss, best)

    def _on_motion(self, message: Any) -> None:
        self.state.motion_feedback(message.feedback.phase, message.feedback.progress)

    def _on_status(self, part: str, message: GoalStatusArray) -> None:
        active = any(item.status in _ACTIVE for item in message.status_list)
        self.state.update(**{part: active})
