"""Teach by drag: from the grasp to the release, checked by the executor before anything moves."""

from __future__ import annotations

from typing import Any

from nicegui import events, ui

from emd_console.session import Session
from emd_console.teaching import points_from
from emd_console.web.console import Console
from emd_console.web.controls import button, give, guarded, tell
from emd_console.web.grasp_turner import GraspTurner
from emd_core.errors import CellError, InvalidInputError

_HINT = "Drag the cloth on the picture: from where to grasp to where to release."


class TeachPanel:
    """The buttons below the picture."""

    def __init__(self, console: Console, session: Session) -> None:
        """Build it and listen to what is drawn."""
        self._console = console
        self._desk = console.desk
        self._session = session
        with ui.row().classes("teach"):
            ui.html(
                '<div class="switch"><button data-key="t" id="teach" aria-pressed="false" '
                'title="key T">Teach</button></div>',
                sanitize=False,
            )
            self._text = ui.label(_HINT).classes("hint").props('id="lesson" aria-live="polite"')
            self._clear = button("Clear", guarded(self._on_clear), "c")
            self._try = button("What if", self._on_try, "w", kind="outline")
            self._execute = button(
                "Execute taught", self._on_execute, "r", kind="unelevated"
            ).classes("accept")
        self._grasp = GraspTurner(console, session, self._ask)
        ui.on("teach_drag", self._on_drag)
        ui.on("teach_hand", self._on_hand)

    def refresh(self) -> None:
        """Say what the executor thinks of the drawing."""
        desk = self._desk
        free = self._session.commands and not desk.doing
        self._clear.set_enabled(free and desk.lesson.release is not None)
        self._try.set_enabled(free and desk.lesson.release is not None)
        self._execute.set_enabled(free and desk.lesson.check is not None)
        self._text.text = self._hint()
        self._grasp.refresh(free)

    def _hint(self) -> str:
        desk = self._desk
        if desk.lesson.refusal:
            return f"Not possible: {desk.lesson.refusal}"
        if desk.lesson.check is not None:
            arms = " and ".join(desk.lesson.check.arms)
            more = "" if len(desk.lesson.grasps) > 1 else " Click a point to add the other hand."
            return f"{arms} can do this, {desk.lesson.check.duration:.0f} s.{more}"
        if desk.lesson.release is not None:
            return "asking the arms"
        return _HINT

    def _on_clear(self) -> None:
        self._session.change("clear lesson", self._desk.lesson.clear)

    async def _on_drag(self, event: events.GenericEventArguments) -> None:
        await self._draw(event.args, "drag")

    async def _on_hand(self, event: events.GenericEventArguments) -> None:
        await self._draw(event.args, "add hand")

    async def _draw(self, arguments: Any, command: str) -> None:
        """Take what was drawn, and let the executor check it."""
        try:
            if self._desk.doing:
                raise InvalidInputError(f"the cell is {self._desk.doing}; wait, or press stop")
            points = points_from(arguments)
            self._session.change(command, lambda: self._take(command, points), points=points)
        except CellError as err:
            tell(str(err))
            return
        await self._ask()

    async def _ask(self) -> None:
        await give(self._session, "check", "asking the arms", self._check)

    def _take(self, command: str, points: list[tuple[float, float]]) -> None:
        wanted = 2 if command == "drag" else 1
        if len(points) != wanted:
            raise InvalidInputError(f"{wanted} point(s) are wanted, got {len(points)}")
        if command == "drag":
            self._desk.lesson.drag(*points)
        else:
            self._desk.lesson.add_hand(*points)

    async def _check(self) -> str:
        return await self._desk.check_lesson(self._console.state.snapshot.projection)

    async def _on_try(self) -> None:
        projection = self._console.state.snapshot.projection
        await give(
            self._session, "what if", "simulating", lambda: self._desk.try_lesson(projection)
        )

    async def _on_execute(self) -> None:
        projection = self._console.state.snapshot.projection
        await give(
            self._session,
            "execute taught",
            "folding as taught",
            lambda: self._desk.execute_lesson(projection),
        )
