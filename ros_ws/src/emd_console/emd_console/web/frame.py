"""What every page has: style, the bar with the state, who commands, and the stop button."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from nicegui import ui

from emd_console.session import Session
from emd_console.web.console import STATIC, Console
from emd_console.web.controls import button, guarded, tell
from emd_core.errors import CellError

REFRESH = 0.4  # seconds
EARLY = "early.js"  # what shows the picture before the framework has built the page


def page_frame(console: Console, session: Session) -> Callable[[], None]:
    """Build the bar; gives what brings it up to date."""
    ui.add_head_html('<link rel="stylesheet" href="/static/console.css">')
    dark = ui.dark_mode(None)
    with ui.header(elevated=False).classes("bar"):
        ui.link("EMD cell", "/").classes("brand")
        ui.html('<div id="status" role="status">connecting</div>', sanitize=False)
        ui.space()
        commander = _Commander(console, session)
        ui.link("Recordings", "/review").classes("nav")
        ui.link("History", "/history").classes("nav")
        button("", lambda: _toggle(dark), "d", "contrast").props('aria-label="light or dark"')
        _stop_button(session)
    return commander.refresh


def plain_page(console: Console, session: Session, name: str) -> None:
    """Make a page that shows no live cell: the bar with its name, keys, and who commands."""
    refresh = page_frame(console, session)

    def update() -> None:
        if ui.context.client.has_socket_connection:
            session.seen()
        refresh()

    ui.timer(REFRESH, update)
    update()
    add_data("PAGE", name)
    add_scripts()


def add_data(name: str, value: Any) -> None:
    """Hand the page's scripts something from the beginning, as `window.<name>`."""
    ui.add_body_html(f"<script>window.{name} = {json.dumps(value)}</script>")


def add_scripts() -> None:
    """Let the page run its scripts: all asked for at once, and run before the framework's."""
    for file in sorted(STATIC.glob("*.js")):
        if file.name == EARLY:
            continue  # stands in the page itself
        ui.add_head_html(f'<link rel="modulepreload" href="/static/{file.name}">')
    ui.add_head_html('<script type="module" src="/static/console.js"></script>')


def _toggle(dark: ui.dark_mode) -> None:
    """Change between light and dark; from the system's choice to dark."""
    dark.value = not dark.value


def _stop_button(session: Session) -> None:
    def stop() -> None:
        try:
            session.stop()
        except CellError as err:
            tell(str(err))
        else:
            tell("stopping", bad=False)

    made = ui.button("STOP", on_click=stop, icon="dangerous", color=None)
    made.props('unelevated id="stop" data-key="Escape" aria-keyshortcuts="Escape" title="key Esc"')
    made.classes("stop")


class _Commander:
    """Says who commands the cell, and lets it change hands."""

    def __init__(self, console: Console, session: Session) -> None:
        self._lease = console.lease
        self._session = session
        self._label = ui.label().classes("commander")
        self._take = button("Take command", guarded(session.take_command), "o", kind="outline")
        self._give = button("Hand over", self._consent, kind="outline")
        self._keep = button("Keep", self._refuse, kind="outline")

    def refresh(self) -> None:
        """Show who commands now."""
        session, asked = self._session, self._lease.asked_by
        holding = session.commands
        self._label.text = self._text(asked)
        self._take.set_visibility(session.may_operate and not holding)
        self._take.set_enabled(not self._lease.asks(session.identity))
        self._give.set_visibility(holding and asked is not None)
        self._keep.set_visibility(holding and asked is not None)

    def _text(self, asked: tuple[str, float] | None) -> str:
        session = self._session
        if not session.may_operate:
            return "you view"
        if session.commands and asked is not None:
            return f"{asked[0]} asks for command, {asked[1]:.0f} s"
        if session.commands:
            return "you command"
        name = self._lease.holder_name
        return f"{name} commands" if name else "nobody commands"

    def _consent(self) -> None:
        self._lease.consent(self._session.identity)

    def _refuse(self) -> None:
        self._lease.refuse(self._session.identity)
