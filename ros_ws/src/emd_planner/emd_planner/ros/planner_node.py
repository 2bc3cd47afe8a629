"""The planner node: an action and a service that turn two voxel grids into a plan."""

from __future__ import annotations

import dataclasses
import math
import sys
from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node
from visualization_msgs.msg import MarkerArray

from emd_core.errors import DoubtfulPlanError, NoObservationError
from emd_core.ros import conversions
from emd_core.ros.heartbeat import Heartbeat
from emd_core.ros.markers import ORANGE, clear_marker, manipulation_markers, voxel_marker
from emd_core.ros.parameters import declare_config
from emd_core.ros.results import set_error
from emd_core.ros.spin import spin_node
from emd_core.ros.worker import SingleWorker
from emd_core.voxel_grid import VoxelGrid
from emd_msgs_py.action import PlanFold
from emd_msgs_py.msg import VoxelGrid as VoxelGridMsg
from emd_msgs_py.srv import PlanFold as PlanFoldService
from emd_planner.config import PLANNERS
from emd_planner.device import resolve_device
from emd_planner.fold_plan import FoldPlan, PlanningProgress
from emd_planner.memory import keep_freed_memory
from emd_planner.plan import plan
from emd_planner.ros.plan_messages import plan_to_message, progress_to_feedback
from emd_planner.ros.regions import declare_keep_out, declare_reach
from emd_planner.ros.served_net import ServedNet
from emd_planner.trust import PlanFigures

_MOST_DOUBT = "max_failure_probability"


class PlannerNode(Node):
    """Serves plans, one at a time."""

    def __init__(self) -> None:
        """Load the network and offer action and service.

        Raises:
            InvalidInputError: If a parameter is out of range.
        """
        super().__init__("planner")
        self._config = declare_config(self, PLANNERS["ours"], "search.")
        self._reach = declare_reach(self)
        self._keep_out = declare_keep_out(self)
        device = resolve_device(self.declare_parameter("device", "auto").value)
        self._net = ServedNet(self, device)
        self._declare_most_doubt()
        self._latest: VoxelGridMsg | None = None
        self.create_subscription(VoxelGridMsg, "perception/voxel_grid", self._on_grid, 5)
        self._markers = self.create_publisher(MarkerArray, "planner/markers", 5)
        self._worker = SingleWorker(self, "planning")
        self._action = self._worker.serve_action(PlanFold, "planner/plan_fold", self._on_goal)
        self.create_service(
            PlanFoldService,
            "planner/plan",
            self._on_request,
            callback_group=self._worker.callback_group,
        )
        self._heartbeat = Heartbeat(self, "plans", lambda: self._worker.what)

    def _declare_most_doubt(self) -> None:
        span = FloatingPointRange(from_value=0.0, to_value=1.0)
        text = "plans that are more likely to fail are refused; 1: none"
        descriptor = ParameterDescriptor(description=text, floating_point_range=[span])
        self.declare_parameter(_MOST_DOUBT, 1.0, descriptor)

    def _on_grid(self, message: VoxelGridMsg) -> None:
        self._latest = message

    def _on_goal(self, goal_handle: ServerGoalHandle, result: PlanFold.Result) -> None:
        self._plan(
            goal_handle.request,
            result,
            goal_handle.publish_feedback,
            lambda: goal_handle.is_cancel_requested,
        )

    async def _on_request(
        self, request: PlanFoldService.Request, response: PlanFoldService.Response
    ) -> PlanFoldService.Response:
        try:
            await self._worker.run(lambda: self._plan(request, response, None, lambda: False))
        except Exception as err:
            return set_error(response, err, self)  # type: ignore[no-any-return]
        return response

    def _plan(
        self,
        request: Any,
        result: Any,
        publish: Callable[[PlanFold.Feedback], None] | None,
        should_stop: Callable[[], bool],
    ) -> None:
        """Plan in the worker's thread and fill the result of action or service."""
        initial = self._initial_grid(request)
        goal = conversions.voxel_grid_from_message(request.goal_grid)
        config = dataclasses.replace(
            self._config,
            restarts=request.restarts or self._config.restarts,
            time_budget=request.time_budget or self._config.time_budget,
        )

        def on_iteration(progress: PlanningProgress) -> None:
            assert publish is not None
            publish(progress_to_feedback(progress, initial, self._table_header()))

        found = plan(
            self._net.get(),
            initial,
            goal,
            request.steps,
            config,
            self._reach,
            request.seed,
            None if publish is None else on_iteration,
            should_stop,
            self._keep_out,
        )
        chance = self._failure_probability(found)
        result.plan = plan_to_message(found, self._table_header(), chance)
        result.loss = found.predicted_loss
        result.planning_time = conversions.duration_to_message(found.planning_ms * 1e-3)
        self._show(found)
        self._refuse_if_doubtful(chance)

    def _failure_probability(self, found: FoldPlan) -> float:
        trust = self._net.trust
        return math.nan if trust is None else trust.failure_probability(PlanFigures.of(found))

    def _refuse_if_doubtful(self, chance: float) -> None:
        most = self.get_parameter(_MOST_DOUBT).value
        if math.isnan(chance) and most < 1.0:
            raise DoubtfulPlanError(
                f"{_MOST_DOUBT} is {most:.2f}, but nothing is known of how the plans of these "
                "weights end; run `./cell fit-trust` for them, or set it to 1"
            )
        if chance > most:
            raise DoubtfulPlanError(
                f"the plan fails with a probability of {chance:.2f}, and {_MOST_DOUBT} is "
                f"{most:.2f}; it is in the result, if you want it nevertheless; otherwise choose "
                "a nearer goal or more steps, or train on cloth like this"
            )

    def _initial_grid(self, request: Any) -> VoxelGrid:
        if not request.use_latest_grid:
            return conversions.voxel_grid_from_message(request.initial_grid)
        if self._latest is None:
            raise NoObservationError(
                "no voxel grid has come on perception/voxel_grid yet; start perception, or send "
                "initial_grid with use_latest_grid false"
            )
        return conversions.voxel_grid_from_message(self._latest)

    def _show(self, found: FoldPlan) -> None:
        header = self._table_header()
        markers = [clear_marker(header, "plan")]
        markers += manipulation_markers(found.manipulations, header, "plan")
        markers.append(voxel_marker(found.predicted_grids[-1], header, "predicted", ORANGE, 0.4))
        self._markers.publish(MarkerArray(markers=markers))

    def _table_header(self) -> Any:
        return conversions.header(self.get_clock().now().to_msg(), conversions.TABLE_FRAME)


def main() -> int:
    """Run the node until interrupted."""
    keep_freed_memory()
    return spin_node(PlannerNode)


if __name__ == "__main__":
    sys.exit(main())
