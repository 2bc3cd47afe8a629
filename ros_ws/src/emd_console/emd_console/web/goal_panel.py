"""Goals to choose from."""

from __future__ import annotations

from functools import partial

from nicegui import events, ui

from emd_console.goals import PRESENT, gallery
from emd_console.grid_file import LARGEST_UPLOAD, grid_from_bytes
from emd_console.session import Session
from emd_console.web.console import Console
from emd_console.web.controls import button, guarded, tell
from emd_core.errors import CellError


class GoalPanel:
    """A gallery of neat folds, the present state, a file."""

    def __init__(self, console: Console, session: Session) -> None:
        """Build it."""
        self._desk = console.desk
        self._session = session
        self._items: dict[str, ui.element] = {}
        with ui.element("div").classes("gallery").props('role="radiogroup" aria-label="goal"'):
            for goal in gallery():
                self._add(goal.name, goal.title)
        with ui.row().classes("goal-extras"):
            self._present = button(
                "Take the present state", guarded(partial(self._choose, PRESENT)), "g"
            )
            upload = ui.upload(
                on_upload=self._on_upload,
                on_rejected=lambda: tell("a voxel grid (.npz) of at most 256 KiB is wanted"),
                max_file_size=LARGEST_UPLOAD,
                auto_upload=True,
            )
            upload.props("accept=.npz").classes("hidden-upload")
            self._file = button("From a file", lambda: upload.run_method("pickFiles"), "f")

    def refresh(self) -> None:
        """Mark what is chosen and bar what may not be done."""
        chosen = self._desk.goal.name if self._desk.goal else ""
        for name, item in self._items.items():
            item.props(f'aria-checked="{str(name == chosen).lower()}"')
        free = self._session.commands and not self._desk.doing
        self._present.set_enabled(free and self._desk.seen is not None)
        self._file.set_enabled(free)

    def _add(self, name: str, title: str) -> None:
        item = ui.element("button").classes("goal").props(f'role="radio" title="{title}"')
        item.props(f'data-goal="{name}"')
        item.on("click", guarded(partial(self._choose, name)))
        with item:
            ui.html(f'<canvas id="goal-{name}"></canvas><span>{title}</span>', sanitize=False)
        self._items[name] = item

    def _choose(self, name: str, *_: object) -> None:
        desk = self._desk
        self._session.change("choose goal", partial(desk.choose_goal, name), goal=name)
        self.refresh()

    async def _on_upload(self, event: events.UploadEventArguments) -> None:
        try:
            grid = grid_from_bytes(await event.file.read())
            self._session.change("upload goal", partial(self._desk.take_file, grid))
        except CellError as err:
            tell(str(err))
        event.sender.reset()  # type: ignore[attr-defined]
