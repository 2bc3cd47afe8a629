"""A cell behind a ROS graph, asked from asyncio while rclpy spins in another thread."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import numpy as np
from action_msgs.srv import CancelGoal
from rclpy.action import ActionClient
from rclpy.node import Node
from std_srvs.srv import Trigger

from emd_console.cell_port import Check, Execution, Observation, Plan
from emd_console.ros.cell_view import EXECUTE_ACTION, PLAN_ACTION, CellView
from emd_console.ros.motion_recorder import MotionRecorder
from emd_core.errors import (
    CancelledError,
    CellError,
    DeadlineError,
    ErrorCode,
    InvalidInputError,
    error_from_code,
)
from emd_core.frames import FloatArray
from emd_core.manipulation import Manipulation
from emd_core.ros import conversions
from emd_core.voxel_grid import VoxelGrid
from emd_msgs_py.action import ExecuteManipulation, PlanFold
from emd_msgs_py.srv import CaptureState, CheckManipulation

_PATIENCE = 10.0  # seconds for a service to be there


class GraphCell:
    """Asks perception, planner, executor and, where there is one, the simulation."""

    def __init__(self, node: Node, view: CellView) -> None:
        """Make the clients on `node`, which the caller spins; `view` gives pictures."""
        self._node = node
        self._view = view
        self._capture = node.create_client(CaptureState, "perception/capture_state")
        self._check = node.create_client(CheckManipulation, "arm_executor/check_manipulation")
        self._home = node.create_client(Trigger, "arm_executor/go_home")
        self._reset = node.create_client(Trigger, "simulation/reset")
        self._plan = ActionClient(node, PlanFold, PLAN_ACTION)
        self._execute = ActionClient(node, ExecuteManipulation, EXECUTE_ACTION)
        self._cancels = [
            node.create_client(CancelGoal, f"{name}/_action/cancel_goal")
            for name in (EXECUTE_ACTION, PLAN_ACTION)
        ]
        self._recorder = MotionRecorder(node)
        self._stops = 0

    async def capture(self) -> Observation:
        """Look at the cloth, in frames taken from now on."""
        response = await self._call(self._capture, CaptureState.Request(), 60.0)
        _raise_error(response)
        states = self._view.state.snapshot.cloth_states
        return Observation(
            conversions.voxel_grid_from_message(response.voxel_grid),
            np.ascontiguousarray(conversions.image_from_message(response.mask)),
            conversions.points_from_message(response.points),
            response.quality,
            response.reason,
            await asyncio.to_thread(self._view.image),
            None if states is None else states.copy(),
        )

    async def plan(
        self, initial: VoxelGrid, goal: VoxelGrid, steps: int, seed: int, restarts: int
    ) -> Plan:
        """Plan manipulations that turn one state into another; `restarts` 0: the default."""
        request = PlanFold.Goal(
            initial_grid=conversions.voxel_grid_to_message(initial, self._header()),
            goal_grid=conversions.voxel_grid_to_message(goal, self._header()),
            steps=steps,
            seed=seed,
            restarts=restarts,
        )
        result = await self._act(self._plan, request)
        if result.error_code != ErrorCode.DOUBTFUL_PLAN:  # its plan is for the operator to judge
            _raise_error(result)
        plan = result.plan
        return Plan(
            tuple(conversions.manipulation_from_message(item) for item in plan.manipulations),
            tuple(conversions.voxel_grid_from_message(item) for item in plan.predicted_grids),
            result.loss,
            plan.expected_error,
            plan.failure_probability,
            conversions.time_from_message(result.planning_time),
        )

    async def check(self, manipulation: Manipulation) -> Check:
        """Plan the arms' motion and check it; nothing moves."""
        message = conversions.manipulation_to_message(manipulation, self._header())
        response = await self._call(
            self._check, CheckManipulation.Request(manipulation=message), 60.0
        )
        _raise_error(response)
        return Check(
            conversions.manipulation_from_message(response.executed),
            tuple(response.arms),
            np.array([[item.x, item.y] for item in response.grasp_directions]),
            tuple(_points(path) for path in response.carry_paths),
            response.duration,
        )

    async def execute(self, manipulation: Manipulation) -> Execution:
        """Carry a manipulation out, and record its motion."""
        message = conversions.manipulation_to_message(manipulation, self._header())
        self._recorder.start()
        try:
            result = await self._act(self._execute, ExecuteManipulation.Goal(manipulation=message))
        finally:
            motion = self._recorder.finish()
        _raise_error(result)
        return Execution(conversions.manipulation_from_message(result.executed), motion)

    async def go_home(self) -> None:
        """Send both arms home."""
        response = await self._call(self._home, Trigger.Request(), 120.0)
        if not response.success:
            raise error_from_code(ErrorCode.UNKNOWN, response.message)

    async def reset(self) -> None:
        """Lay a flat cloth before the simulated robot."""
        await self._call(self._reset, Trigger.Request(), 30.0)
        await asyncio.sleep(0.3)  # until pictures of it are on their way

    def can_reset(self) -> bool:
        """Whether there is a simulation that can be reset."""
        return bool(self._reset.service_is_ready())

    def stop(self) -> None:
        """Cancel all goals of both actions, whoever sent them (an empty request means all)."""
        self._stops += 1
        for client in self._cancels:
            if client.service_is_ready():
                client.call_async(CancelGoal.Request())

    async def _act(self, client: ActionClient, goal: Any) -> Any:
        """Send a goal and wait for its result; one that a stop overtakes never starts."""
        stops = self._stops
        await self._wait_until(client.server_is_ready, "the node that does this")
        if stops != self._stops:
            raise CancelledError("the stop came before anything began")
        handle = await _answer(client.send_goal_async(goal), 30.0, "the goal's acceptance")
        if not handle.accepted:
            raise InvalidInputError("the goal was refused; see the node's log")
        if stops != self._stops:
            handle.cancel_goal_async()
        response = await _answer(handle.get_result_async(), 600.0, "the result")
        return response.result

    async def _call(self, client: Any, request: Any, timeout: float) -> Any:
        await self._wait_until(client.service_is_ready, client.srv_name)
        return await _answer(client.call_async(request), timeout, client.srv_name)

    async def _wait_until(self, ready: Callable[[], bool], what: str) -> None:
        deadline = asyncio.get_running_loop().time() + _PATIENCE
        while not ready():
            if asyncio.get_running_loop().time() > deadline:
                raise DeadlineError(
                    f"{what} is not there; look at the nodes' state, or start the cell with "
                    "`./cell up`"
                )
            await asyncio.sleep(0.05)

    def _header(self) -> Any:
        return conversions.header(self._node.get_clock().now().to_msg(), conversions.TABLE_FRAME)


async def _answer(future: Any, timeout: float, what: str) -> Any:
    """Await an rclpy future from asyncio.

    Raises:
        DeadlineError: If nothing comes in time.
    """
    loop = asyncio.get_running_loop()
    arrived = asyncio.Event()
    future.add_done_callback(lambda _: loop.call_soon_threadsafe(arrived.set))
    try:
        await asyncio.wait_for(arrived.wait(), timeout)
    except TimeoutError as err:
        raise DeadlineError(f"no answer from {what} within {timeout:.0f} s") from err
    return future.result()


def _points(path: Any) -> FloatArray:
    return np.array([[point.x, point.y, point.z] for point in path.points]).reshape(-1, 3)


def _raise_error(result: Any) -> None:
    if result.error_code != ErrorCode.NONE:
        error: CellError = error_from_code(result.error_code, result.error_msg)
        raise error
