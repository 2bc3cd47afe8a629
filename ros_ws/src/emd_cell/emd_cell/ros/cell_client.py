"""A client of the cell's nodes: capture, plan, execute, as plain calls."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import Image
from std_srvs.srv import Trigger

from emd_core.errors import DeadlineError, ErrorCode, InvalidInputError, error_from_code
from emd_core.independent_manipulation import HandsManipulation
from emd_core.manipulation import Manipulation
from emd_core.ros import conversions
from emd_core.voxel_grid import VoxelGrid
from emd_msgs_py.action import ExecuteManipulation, PlanFold
from emd_msgs_py.msg import VoxelGrid as VoxelGridMsg
from emd_msgs_py.srv import CaptureState


@dataclass(frozen=True)
class Observation:
    """What perception made of the camera's frames.

    Attributes:
        grid: The cloth's voxel grid.
        quality: 0..1.
        reason: Why the quality is what it is.
    """

    grid: VoxelGrid
    quality: float
    reason: str


@dataclass(frozen=True)
class Plan:
    """What the planner answered.

    Attributes:
        manipulations: In the order of execution.
        predicted_grids: Expected state after each.
        predicted_loss: loss_s of the last one to the goal.
        expected_error: Voxel MSE to be expected of the outcome.
        failure_probability: That the outcome scores more than half of what the present state
            does; NaN if unknown.
        planning_ms: Milliseconds that planning took.
    """

    manipulations: list[Manipulation]
    predicted_grids: list[VoxelGrid]
    predicted_loss: float
    expected_error: float
    failure_probability: float
    planning_ms: float


class CellClient(Node):
    """Talks to perception, planner, executor and, where there is one, the simulation.

    Every call blocks until its answer is there, spinning this node meanwhile, and raises the
    CellError that the answer carries.
    """

    def __init__(self, on_spin: Callable[[], None] | None = None) -> None:
        """Connect; `on_spin` is called about 20 times a second during every wait."""
        super().__init__("folding_loop")
        self._on_spin = on_spin or (lambda: None)
        self._spinner = SingleThreadedExecutor()
        self._spinner.add_node(self)
        self._capture = self.create_client(CaptureState, "perception/capture_state")
        self._plan = ActionClient(self, PlanFold, "planner/plan_fold")
        self._execute = ActionClient(
            self, ExecuteManipulation, "arm_executor/execute_manipulation"
        )
        self._go_home = self.create_client(Trigger, "arm_executor/go_home")
        self._reset = self.create_client(Trigger, "simulation/reset")
        self._truth: VoxelGrid | None = None
        self.overview_frames: list[NDArray[np.uint8]] = []
        self.create_subscription(VoxelGridMsg, "simulation/voxel_grid", self._on_truth, 5)
        self.create_subscription(Image, "simulation/overview/image_raw", self._on_overview, 50)

    def wait_for_cell(self, timeout: float = 300.0, simulated: bool = False) -> None:
        """Wait until every node offers its service, with `simulated` the simulation too.

        The first start of a simulation compiles its kernels, which takes up to minutes.

        Raises:
            DeadlineError: If one is missing after `timeout` seconds.
        """
        wanted: dict[str, Callable[[], bool]] = {
            "perception/capture_state": self._capture.service_is_ready,
            "planner/plan_fold": self._plan.server_is_ready,
            "arm_executor/execute_manipulation": self._execute.server_is_ready,
        }
        if simulated:
            wanted["simulation/reset"] = self._reset.service_is_ready
        deadline = time.monotonic() + timeout
        while missing := [name for name, is_ready in wanted.items() if not is_ready()]:
            if time.monotonic() > deadline:
                raise DeadlineError(
                    f"{', '.join(missing)} did not appear within {timeout:.0f} s; start the cell "
                    "with `./cell up`"
                )
            self._spin()

    def capture(self, timeout: float = 60.0) -> Observation:
        """Observe the cloth in frames taken from now on."""
        response = self._wait(self._capture.call_async(CaptureState.Request()), timeout, "capture")
        self._raise_error(response)
        grid = conversions.voxel_grid_from_message(response.voxel_grid)
        return Observation(grid, response.quality, response.reason)

    def plan(
        self,
        initial: VoxelGrid,
        goal: VoxelGrid,
        steps: int,
        seed: int,
        restarts: int = 0,
        on_feedback: Callable[[int, float], None] | None = None,
    ) -> Plan:
        """Plan from `initial` to `goal`; `on_feedback` gets iteration and best loss."""
        header = conversions.header(self.get_clock().now().to_msg(), conversions.TABLE_FRAME)
        request = PlanFold.Goal(
            initial_grid=conversions.voxel_grid_to_message(initial, header),
            goal_grid=conversions.voxel_grid_to_message(goal, header),
            steps=steps,
            seed=seed,
            restarts=restarts,
        )
        result = self._act(
            self._plan,
            request,
            lambda message: on_feedback and on_feedback(message.iteration, message.best_loss),
            timeout=600.0,
        )
        return Plan(
            [conversions.manipulation_from_message(item) for item in result.plan.manipulations],
            [conversions.voxel_grid_from_message(item) for item in result.plan.predicted_grids],
            result.loss,
            result.plan.expected_error,
            result.plan.failure_probability,
            conversions.time_from_message(result.planning_time) * 1e3,
        )

    def execute(
        self,
        manipulation: HandsManipulation,
        on_feedback: Callable[[str, float], None] | None = None,
    ) -> HandsManipulation:
        """Carry out a manipulation; gives it back with the points really grasped."""
        header = conversions.header(self.get_clock().now().to_msg(), conversions.TABLE_FRAME)
        request = ExecuteManipulation.Goal(
            manipulation=conversions.manipulation_to_message(manipulation, header)
        )
        result = self._act(
            self._execute,
            request,
            lambda message: on_feedback and on_feedback(message.phase, message.progress),
            timeout=600.0,
        )
        return conversions.hands_manipulation_from_message(result.executed)

    def go_home(self, timeout: float = 120.0) -> None:
        """Send both arms home."""
        response = self._wait(self._go_home.call_async(Trigger.Request()), timeout, "go_home")
        if not response.success:
            raise error_from_code(ErrorCode.UNKNOWN, response.message)

    def true_grid(self, timeout: float = 30.0) -> VoxelGrid:
        """The simulator's own grid, from now on."""
        self._truth = None
        deadline = time.monotonic() + timeout
        while self._truth is None:
            if time.monotonic() > deadline:
                raise DeadlineError(f"simulation/voxel_grid did not come within {timeout:.0f} s")
            self._spin()
        return self._truth

    def reset_simulation(self, timeout: float = 30.0) -> None:
        """Lay a flat cloth before the simulated robot and put its arms aside."""
        self._wait(self._reset.call_async(Trigger.Request()), timeout, "the reset")

    def send_goal(
        self,
        client: ActionClient,
        request: Any,
        on_feedback: Callable[[Any], Any] | None = None,
    ) -> ClientGoalHandle:
        """Send a goal and wait until it is accepted."""
        tell = on_feedback or (lambda feedback: None)
        sent = client.send_goal_async(request, lambda message: tell(message.feedback))
        goal_handle: ClientGoalHandle = self._wait(sent, 30.0, "the goal's acceptance")
        if not goal_handle.accepted:
            raise InvalidInputError("the goal was refused; see the node's log")
        return goal_handle

    def cancel(self, goal_handle: ClientGoalHandle, timeout: float = 30.0) -> Any:
        """Cancel a goal and give the result with which it ends."""
        self._wait(goal_handle.cancel_goal_async(), timeout, "cancelling")
        return self._wait(goal_handle.get_result_async(), timeout, "the end of the goal").result

    def _act(
        self, client: ActionClient, request: Any, on_feedback: Callable[[Any], Any], timeout: float
    ) -> Any:
        """Send a goal, follow it, and give its result; cancel it when we are interrupted."""
        goal_handle = self.send_goal(client, request, on_feedback)
        try:
            response = self._wait(goal_handle.get_result_async(), timeout, "the goal's result")
        except BaseException:
            self.cancel(goal_handle)
            raise
        self._raise_error(response.result)
        return response.result

    def _wait(self, future: Future, timeout: float, what: str) -> Any:
        deadline = time.monotonic() + timeout
        while not future.done():
            if time.monotonic() > deadline:
                raise DeadlineError(f"no answer to {what} within {timeout:.0f} s")
            self._spin()
        return future.result()

    def _spin(self) -> None:
        self._spinner.spin_once(timeout_sec=0.05)
        self._on_spin()

    def _raise_error(self, result: Any) -> None:
        if result.error_code != ErrorCode.NONE:
            raise error_from_code(result.error_code, result.error_msg)

    def _on_truth(self, message: VoxelGridMsg) -> None:
        self._truth = conversions.voxel_grid_from_message(message)

    def _on_overview(self, message: Image) -> None:
        self.overview_frames.append(conversions.rgb_from_message(message))
