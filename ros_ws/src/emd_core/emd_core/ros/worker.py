"""Long work in a thread, one piece at a time, so that a node's executor stays free."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, TypeVar

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.task import Future

from emd_core.errors import BusyError, CancelledError
from emd_core.ros.results import set_error

T = TypeVar("T")


class SingleWorker:
    """Runs one piece of work at a time; its result is awaited without blocking the executor.

    A blocked single-threaded executor could not even receive a cancel request. Callbacks that
    await `run` belong in `callback_group`: in a mutually exclusive group, such as a node's default
    one, a callback that awaits keeps all others of the group from running.
    """

    def __init__(self, node: Node, what: str) -> None:
        """Serve `node`; `what` names the work in the refusal of a second one."""
        self._node = node
        self._what = what
        self._lock = threading.Lock()
        self.callback_group = ReentrantCallbackGroup()

    @property
    def what(self) -> str | None:
        """What is under way, in the words of the refusal; None while nothing is."""
        return self._what if self._lock.locked() else None

    async def run(self, work: Callable[[], T]) -> T:
        """Run `work` in a thread and give its result or raise its exception.

        Raises:
            BusyError: If another piece of work is under way.
        """
        if not self._lock.acquire(blocking=False):
            raise BusyError(
                f"{self._node.get_name()} is already {self._what}; "
                "wait for its result or cancel it"
            )
        try:
            future: Future = Future()
            threading.Thread(target=self._work, args=(work, future), daemon=True).start()
            return await future  # type: ignore[no-any-return]
        finally:
            self._lock.release()

    def serve_action(
        self, action_type: Any, name: str, work: Callable[[ServerGoalHandle, Any], None]
    ) -> ActionServer:
        """Offer an action whose goals are done by `work`, in a thread, one at a time.

        Args:
            action_type: Its result has `error_code` and `error_msg`.
            name: Name of the action.
            work: Takes the goal's handle and fills the result. A CancelledError ends the goal as
                cancelled, any other exception as aborted, with code and text in the result.
        """

        async def execute(goal_handle: ServerGoalHandle) -> Any:
            result = action_type.Result()
            try:
                await self.run(lambda: work(goal_handle, result))
            except CancelledError as err:
                goal_handle.canceled()
                return set_error(result, err, self._node)
            except Exception as err:
                goal_handle.abort()
                return set_error(result, err, self._node)
            goal_handle.succeed()
            return result

        return ActionServer(
            self._node,
            action_type,
            name,
            execute_callback=execute,
            goal_callback=lambda request: GoalResponse.ACCEPT,
            cancel_callback=lambda goal_handle: CancelResponse.ACCEPT,
            callback_group=self.callback_group,
        )

    def _work(self, work: Callable[[], T], future: Future) -> None:
        try:
            future.set_result(work())
        except BaseException as err:  # handed to the awaiting callback, which reports it
            future.set_exception(err)
        if self._node.executor is not None:
            self._node.executor.wake()  # an awaiting callback goes on at the executor's next turn
