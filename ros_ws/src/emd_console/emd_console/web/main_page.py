"""The page of the cell: what it sees and intends, and what the operator does about it."""

from __future__ import annotations

from nicegui import ui
from nicegui.elements import scene  # noqa: F401  (puts three.js into the pages' import map)
from starlette.requests import Request

from emd_console.access import Role
from emd_console.goals import gallery
from emd_console.sections import heights
from emd_console.session import Session
from emd_console.web.console import STATIC, Console
from emd_console.web.controls import guarded
from emd_console.web.frame import EARLY, REFRESH, add_data, add_scripts, page_frame
from emd_console.web.goal_panel import GoalPanel
from emd_console.web.guard import ROLE, VISITOR
from emd_console.web.sections_html import figure
from emd_console.web.teach_panel import TeachPanel
from emd_console.web.work_panel import WorkPanel


def add_main_page(console: Console) -> None:
    """Serve the page at `/`."""

    @ui.page("/", response_timeout=30.0)
    def main_page(request: Request) -> None:
        _build(console, open_session(console, request))


def open_session(console: Console, request: Request) -> Session:
    """Make a visitor's session; the first operator commands."""
    role: Role = request.scope[ROLE]
    visitor: str = request.scope[VISITOR]
    address = request.client.host if request.client else "unknown"
    name = f"{address} {visitor[:4]}"
    session = Session(console.desk, console.lease, console.log, role, name, visitor)
    if session.may_operate and console.lease.holder is None:
        session.take_command()
    return session


def _build(console: Console, session: Session) -> None:
    refresh = page_frame(console, session)
    with ui.element("main").classes("board"):
        with ui.element("div").classes("column"):
            with ui.element("section").classes("card"):
                _camera()
                teach = TeachPanel(console, session)
            with ui.element("section").classes("card history"):
                ui.html('<div id="folds"></div>', sanitize=False)
        with ui.element("div").classes("column"):
            with ui.element("section").classes("card"):
                goals = GoalPanel(console, session)
                with ui.element("div").classes("grids"):
                    for name in ("now", "predicted", "goal"):
                        figure(name, name.capitalize())
                work = WorkPanel(console, session)
            with ui.element("section").classes("card tabs"):
                _tabs()
    script = (STATIC / EARLY).read_text(encoding="utf-8")
    ui.add_body_html(f"{_EARLY}<script>{script}</script>")
    _data()

    def update() -> None:
        if ui.context.client.has_socket_connection:
            session.seen()
        for part in (refresh, teach.refresh, goals.refresh, work.refresh):
            guarded(part)()

    ui.timer(REFRESH, update)
    update()


def _camera() -> None:
    with ui.element("div").classes("screen").props('id="screen"'):
        ui.html('<div id="picture-place"></div>', sanitize=False)
        ui.html(
            '<canvas id="overlay" width="640" height="480" tabindex="0" role="application" '
            'aria-label="Camera picture. In teach mode, drag from grasp to release; or move the '
            'cross with the arrow keys and press Enter."></canvas>',
            sanitize=False,
        )


def _tabs() -> None:
    """Build the panels below; what is in them the page's scripts draw."""
    names = {"robot": "Robot", "search": "Search", "nodes": "Nodes"}
    buttons = "".join(
        f'<button role="tab" data-tab="{name}" data-key="{number}">{title}</button>'
        for number, (name, title) in enumerate(names.items(), start=1)
    )
    ui.html(f'<div role="tablist" class="tablist">{buttons}</div>', sanitize=False)
    contents = {
        "robot": '<div id="robot"><canvas></canvas><p class="hint"></p></div>',
        "search": '<div id="search"><canvas id="curve"></canvas></div>',
        "nodes": '<div id="nodes"></div>',
    }
    for name, content in contents.items():
        with ui.element("div").classes("panel").props(f'data-panel="{name}"'):
            ui.html(content, sanitize=False)


def _data() -> None:
    """Hand the page what its scripts need from the beginning."""
    thumbs = {goal.name: heights(goal.grid) for goal in gallery()}
    add_data("EMD", {"gallery": thumbs})
    add_scripts()


# Where the picture is seen until the framework has built the page, laid out as it will be then.
_EARLY = """
<div id="early" class="board"><div class="column"><section class="card"><div class="screen">
<canvas id="picture" width="640" height="480"></canvas>
<div id="picture-note">waiting for the camera</div>
</div></section></div></div>
"""
