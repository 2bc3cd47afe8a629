"""One visitor: what may be commanded, and that all that is commanded is logged."""

from __future__ import annotations

import uuid
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from typing import Any

from emd_console.access import Role
from emd_console.command_log import CommandLog
from emd_console.desk import Desk
from emd_console.operator_lease import OperatorLease
from emd_core.errors import BusyError, CellError


@dataclass
class Session:
    """A visitor with open pages.

    Attributes:
        desk: The work that all share.
        lease: Who commands.
        log: Of all commands.
        role: What this visitor may do.
        name: How the visitor is called.
        identity: Of the visitor's browser; its pages command together.
    """

    desk: Desk
    lease: OperatorLease
    log: CommandLog
    role: Role
    name: str
    identity: str = field(default_factory=lambda: uuid.uuid4().hex)

    @property
    def who(self) -> str:
        """Name and role, as the log has them."""
        return f"{self.name} ({self.role})"

    @property
    def may_operate(self) -> bool:
        """Whether the token is an operator's."""
        return self.role is Role.OPERATOR

    @property
    def commands(self) -> bool:
        """Whether this visitor commands the cell now."""
        return self.may_operate and self.lease.holder == self.identity

    def take_command(self) -> bool:
        """Take command or ask for it; True if it is held now."""
        self.require_operator("take command")
        got = self.lease.take(self.identity, self.name)
        self.log.write(self.who, "take command", "done" if got else "asked for")
        return got

    def seen(self) -> None:
        """The visitor is there. Who is not seen for a while commands no longer."""
        self.lease.seen(self.identity)

    async def give(
        self, command: str, doing: str, task: Callable[[], Awaitable[str]], **details: Any
    ) -> bool:
        """Let the cell do something that takes a while; False if it went wrong.

        Args:
            command: Its name in the log.
            doing: What is said meanwhile.
            task: What to do; it gives the outcome in words.
            details: For the log.

        Raises:
            CellError: If this visitor may not, or the cell is busy; nothing was done.
        """
        self.require_command(command, **details)
        if self.desk.doing:
            self.log.write(self.who, command, f"refused: busy {self.desk.doing}", **details)
            raise BusyError(f"the cell is {self.desk.doing}; wait, or press stop")
        self.log.write(self.who, command, "begun", **details)
        self.desk.who = self.who
        good = await self.desk.work(doing, task)
        self.log.write(self.who, command, f"{'done' if good else 'failed'}: {self.desk.message}")
        return good

    def change(self, command: str, task: Callable[[], None], **details: Any) -> None:
        """Change something that moves nothing, such as the goal.

        Raises:
            CellError: If this visitor may not, or it cannot be done.
        """
        self.require_command(command, **details)
        task()
        self.log.write(self.who, command, "done", **details)

    def stop(self) -> None:
        """Stop every motion and search. Any operator may, whoever commands.

        Raises:
            BusyError: If this is a viewer.
        """
        self.require_operator("stop")
        self.desk.stop()
        self.log.write(self.who, "stop", "done")

    def require_command(self, command: str, **details: Any) -> None:
        """Complain unless this visitor commands the cell now."""
        self.require_operator(command)
        try:
            self.lease.require(self.identity)
        except CellError as err:
            self.log.write(self.who, command, f"refused: {err}", **details)
            raise

    def require_operator(self, command: str) -> None:
        """Complain unless the token is an operator's."""
        if not self.may_operate:
            self.log.write(self.who, command, "refused: viewers only look")
            raise BusyError("viewers only look; open the page with the operator's link to command")
