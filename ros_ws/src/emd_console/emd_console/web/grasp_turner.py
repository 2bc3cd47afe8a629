"""Turns the direction from which a hand comes to the hem, by its handle or by keys."""

from __future__ import annotations

import math
from collections.abc import Awaitable, Callable
from functools import partial

from nicegui import events, ui

from emd_console.projection import TableProjection
from emd_console.session import Session
from emd_console.teaching import points_from
from emd_console.web.console import Console
from emd_console.web.controls import button, tell
from emd_core.errors import CellError, InvalidInputError

_STEP = math.radians(10.0)


class GraspTurner:
    """Buttons that turn one hand; each change is checked by the executor at once."""

    def __init__(
        self, console: Console, session: Session, ask: Callable[[], Awaitable[None]]
    ) -> None:
        """Build them and listen to the handles.

        Args:
            console: The console.
            session: Whose buttons these are.
            ask: Lets the executor check what is drawn.
        """
        self._state, self._desk = console.state, console.desk
        self._session, self._ask = session, ask
        self._hand = 0
        with ui.row().classes("turn") as self._row:
            ui.label("Turn the grasp").classes("hint")
            self._other = button("", self._on_other, "h", kind="outline")
            self._left = button("", partial(self._on_turn, _STEP), ",", "rotate_left")
            self._right = button("", partial(self._on_turn, -_STEP), ".", "rotate_right")
            self._left.props('aria-label="turn the grasp counterclockwise"')
            self._right.props('aria-label="turn the grasp clockwise"')
            self._free = button("Let the arms choose", self._on_free, "b")
        ui.on("teach_turn", self._on_handle)

    def refresh(self, free: bool) -> None:
        """Show the buttons while something can be turned, which `free` allows."""
        lesson = self._desk.lesson
        self._hand = min(self._hand, max(len(lesson.grasps) - 1, 0))
        asked = any(direction is not None for direction in lesson.directions)
        self._row.set_visibility(lesson.check is not None or asked)
        self._other.set_visibility(len(lesson.grasps) > 1)
        arms = lesson.check.arms if lesson.check else ()
        known = self._hand < len(arms)
        self._other.text = f"{arms[self._hand]} hand" if known else f"hand {self._hand + 1}"
        for made in (self._other, self._left, self._right):
            made.set_enabled(free)
        self._free.set_enabled(free and asked)

    def _on_other(self) -> None:
        self._hand = 1 - self._hand
        self.refresh(free=True)

    async def _on_turn(self, angle: float) -> None:
        hand = self._hand
        await self._change("turn grasp", lambda at: self._desk.lesson.turn_by(hand, angle, at))

    async def _on_handle(self, event: events.GenericEventArguments) -> None:
        def turn(projection: TableProjection) -> None:
            points = points_from(event.args)
            hand = event.args.get("hand")
            if len(points) != 1 or not isinstance(hand, int):
                raise InvalidInputError("the number of a hand and one point are wanted")
            self._desk.lesson.turn(hand, points[0], projection)

        await self._change("turn grasp", turn)

    async def _on_free(self) -> None:
        def free(_: TableProjection) -> None:
            for hand in range(len(self._desk.lesson.grasps)):
                self._desk.lesson.free(hand)

        await self._change("free grasp", free)

    async def _change(self, command: str, task: Callable[[TableProjection], None]) -> None:
        """Change the drawing, if this visitor may, and have it checked."""
        try:
            if self._desk.doing:
                raise InvalidInputError(f"the cell is {self._desk.doing}; wait, or press stop")
            projection = self._state.snapshot.projection
            if projection is None:
                raise InvalidInputError("the camera's pose is not known yet; wait")
            self._session.change(command, partial(task, projection))
        except CellError as err:
            tell(str(err))
            return
        await self._ask()
