"""Long work in a thread, one piece at a time, so that a node's executor stays free."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TypeVar

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.task import Future

from emd_core.errors import BusyError

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

    def _work(self, work: Callable[[], T], future: Future) -> None:
        try:
            future.set_result(work())
        except BaseException as err:  # handed to the awaiting callback, which reports it
            future.set_exception(err)
        if self._node.executor is not None:
            self._node.executor.wake()  # an awaiting callback goes on at the executor's next turn
