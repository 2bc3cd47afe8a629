"""The executor node: carries out manipulations with the arms."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node
from std_msgs.msg import Header
from std_srvs.srv import SetBool, Trigger
from visualization_msgs.msg import MarkerArray

from emd_arm_executor.config import ExecutionConfig, MotionConfig
from emd_arm_executor.executor import MotionExecutor
from emd_arm_executor.manipulation_runner import ManipulationRunner, RunCallbacks
from emd_arm_executor.motion_plan import MotionPlan, PhaseName
from emd_arm_executor.motion_planner import MotionPlanner
from emd_arm_executor.robot_description import hiro_description, load_description
from emd_arm_executor.robot_model import RobotModel
from emd_arm_executor.ros.check_messages import executed_manipulation, fill_check
from emd_arm_executor.ros.cloth_sight import ClothSight
from emd_arm_executor.ros.ros_robot import RosRobot
from emd_arm_executor.silhouette import Silhouette
from emd_core.independent_manipulation import HandsManipulation
from emd_core.ros import conversions
from emd_core.ros.heartbeat import Heartbeat
from emd_core.ros.markers import BLUE, GREEN, clear_marker, line_marker
from emd_core.ros.parameters import declare_config
from emd_core.ros.results import set_error
from emd_core.ros.spin import spin_node
from emd_core.ros.worker import SingleWorker
from emd_msgs_py.action import ExecuteManipulation
from emd_msgs_py.msg import Manipulation as ManipulationMsg
from emd_msgs_py.srv import CheckManipulation

# Messages take a while to both controllers.
_EXECUTION = ExecutionConfig(start_delay=0.05)


class ExecutorNode(Node):
    """Plans the whole motion, checks it, and only then moves; one manipulation at a time."""

    def __init__(self) -> None:
        """Load the robot's model and offer the action, the pause and the way home."""
        super().__init__("arm_executor")
        config = declare_config(self, MotionConfig(execution=_EXECUTION))
        file = self.declare_parameter("robot_file", "").value
        description = load_description(Path(file)) if file else hiro_description()
        model = RobotModel(description, config)
        self._robot = RosRobot(self, description)
        motion = MotionExecutor(self._robot, model)
        self._paused = False
        self._markers = self.create_publisher(MarkerArray, "arm_executor/markers", 5)
        self._worker = SingleWorker(self, "moving the arms")
        self._sight = ClothSight(self, config.sight, self._worker.callback_group)
        self._runner = ManipulationRunner(MotionPlanner(model), motion, self._sight.look)
        self._action = self._worker.serve_action(
            ExecuteManipulation, "arm_executor/execute_manipulation", self._execute
        )
        self.create_service(
            Trigger,
            "arm_executor/go_home",
            self._on_go_home,
            callback_group=self._worker.callback_group,
        )
        self.create_service(
            CheckManipulation,
            "arm_executor/check_manipulation",
            self._on_check,
            callback_group=self._worker.callback_group,
        )
        self.create_service(
            SetBool,
            "arm_executor/pause",
            self._on_pause,
            callback_group=self._worker.callback_group,
        )
        self._heartbeat = Heartbeat(self, "arms", lambda: self._worker.what)

    def _execute(self, goal_handle: ServerGoalHandle, result: ExecuteManipulation.Result) -> None:
        """Plan and move in the worker's thread."""
        manipulation, silhouette = self._task(goal_handle.request.manipulation)
        callbacks = RunCallbacks(
            on_plan=lambda plan: self._announce(plan, result),
            on_progress=lambda *progress: self._feed_back(goal_handle, *progress),
            should_stop=lambda: goal_handle.is_cancel_requested,
            should_pause=lambda: self._paused,
        )
        self._runner.run(manipulation, silhouette, callbacks)

    def _announce(self, plan: MotionPlan, result: ExecuteManipulation.Result) -> None:
        for reason in plan.rejected:
            self.get_logger().info(f"candidate given up: {reason}")
        self._show(plan)
        result.executed = conversions.manipulation_to_message(
            executed_manipulation(plan), self._table_header()
        )

    def _task(self, message: ManipulationMsg) -> tuple[HandsManipulation, Silhouette]:
        """Read what is to be done, and with which cloth."""
        return conversions.hands_manipulation_from_message(message), self._sight.latest()

    async def _on_check(
        self, request: CheckManipulation.Request, response: CheckManipulation.Response
    ) -> CheckManipulation.Response:
        try:
            plan = await self._worker.run(lambda: self._check(request.manipulation))
        except Exception as err:
            return set_error(response, err, self)  # type: ignore[no-any-return]
        self._show(plan)
        return fill_check(response, plan, self._table_header())

    def _check(self, message: ManipulationMsg) -> MotionPlan:
        manipulation, silhouette = self._task(message)
        joints = self._robot.joint_positions()
        return self._runner.planner.plan_motion(manipulation, silhouette, joints)

    def _feed_back(
        self, goal_handle: ServerGoalHandle, plan: MotionPlan, phase: PhaseName, share: float
    ) -> None:
        names = [item.name for item in plan.phases]
        before = sum(item.duration for item in plan.phases[: names.index(phase)])
        now = before + share * plan.phases[names.index(phase)].duration
        goal_handle.publish_feedback(
            ExecuteManipulation.Feedback(phase=phase.value, progress=now / plan.duration)
        )

    async def _on_go_home(
        self, _: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        try:
            await self._worker.run(self._go_home)
        except Exception as err:
            failed = set_error(ExecuteManipulation.Result(), err, self)
            response.success, response.message = False, failed.error_msg
            return response
        response.success, response.message = True, "both arms are home"
        return response

    def _go_home(self) -> None:
        self._runner.go_home(RunCallbacks(should_pause=lambda: self._paused))

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        """Let the arms rest on their path from now on, or go on; heard while they move."""
        self._paused = request.data
        response.success = True
        response.message = "the arms pause" if request.data else "the arms go on"
        return response

    def _show(self, plan: MotionPlan) -> None:
        """Publish hems as grasped and the tools' via-poses."""
        header = self._table_header()
        markers = [clear_marker(header, "hem"), clear_marker(header, "via_poses")]
        for number, (arm, grasp) in enumerate(plan.grasps.items()):
            hem = np.array(grasp.at(0.05, 0.0)[:3, 3])
            ends = np.vstack([hem, grasp.transform_tool_to_table[:3, 3]])
            markers.append(line_marker(ends, header, "hem", number, GREEN))
            path = plan.via_poses_in_table[arm][:, :3, 3]
            markers.append(line_marker(path, header, "via_poses", number, BLUE))
        self._markers.publish(MarkerArray(markers=markers))

    def _table_header(self) -> Header:
        return conversions.header(self.get_clock().now().to_msg(), conversions.TABLE_FRAME)


def main() -> int:
    """Run the node until interrupted."""
    return spin_node(ExecutorNode)


if __name__ == "__main__":
    sys.exit(main())
