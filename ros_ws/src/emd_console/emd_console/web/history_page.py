"""The page of what the cell did, run by run, with a report of it to send around."""

from __future__ import annotations

from statistics import median

from fastapi import FastAPI, Response
from nicegui import ui
from starlette.requests import Request

from emd_console.history import Run, read_history
from emd_console.report import report_html
from emd_console.session import Session
from emd_console.web.console import Console
from emd_console.web.frame import plain_page
from emd_console.web.main_page import open_session

_SHOWN = 30  # runs
_PICTURES = 8  # of a run


def add_history_page(console: Console, app: FastAPI) -> None:
    """Serve the page at `/history`, and reports as files beside it."""

    @ui.page("/history", response_timeout=30.0)
    def history_page(request: Request) -> None:
        session: Session = open_session(console, request)
        plain_page(console, session, "history")
        _show(read_history(console.store.root.parent))

    @app.get("/history/report.html")
    def whole_report() -> Response:
        return _file(read_history(console.store.root.parent), "emd_cell_report.html")

    @app.get("/history/{number:int}/report.html")
    def report_of_a_run(number: int) -> Response:
        runs = read_history(console.store.root.parent)[number : number + 1]
        return _file(runs, f"emd_cell_run_{number}.html")


def _file(runs: list[Run], name: str) -> Response:
    """A report as a file to keep."""
    if not runs:
        return Response("there is no such run\n", 404, media_type="text/plain")
    headers = {"content-disposition": f'attachment; filename="{name}"'}
    return Response(report_html(runs), media_type="text/html", headers=headers)


def _show(runs: list[Run]) -> None:
    with ui.element("main").classes("review"):
        with ui.row().classes("review-head"):
            count = len(runs)
            ui.label(f"{count} run{'' if count == 1 else 's'} of the cell").classes("title")
            ui.space()
            if runs:
                _download("Report on all runs", "/history/report.html")
        for run in reversed(runs[-_SHOWN:]):
            _card(run)
        if not runs:
            ui.label("Nothing recorded yet: execute a plan, or teach one.").classes("hint")


def _card(run: Run) -> None:
    with ui.element("article").classes("card run"):
        with ui.row().classes("review-head"):
            ui.label(f"Run {run.number}, {run.start.replace('T', ' ')[:16]} UTC").classes("title")
            ui.space()
            _download("Report", f"/history/{run.number}/report.html")
        ui.label(run_text(run)).classes("hint")
        with ui.element("div").classes("strip"):
            first, last = run.examples[0], run.examples[-_PICTURES:]
            for number, moment in [(first.number, "before"), *((e.number, "after") for e in last)]:
                ui.html(
                    f'<a href="/replay/{number}"><img src="/examples/{number}/{moment}.jpg" '
                    f'loading="lazy" alt="{moment} manipulation {number}; replay it"></a>',
                    sanitize=False,
                )


def _download(text: str, address: str) -> None:
    ui.link(text, address).classes("nav").props("download")


def run_text(run: Run) -> str:
    """Say in a sentence what was done."""
    parts = [f"{run.count('planned')} planned, {run.count('taught')} taught"]
    if run.scores:
        before, after = (median(values) for values in zip(*run.scores, strict=True))
        parts.append(f"median voxel MSE to the goal {before:.4f} before, {after:.4f} after")
    if run.seconds is not None:
        parts.append(f"{run.seconds:.0f} s each")
    if run.stops:
        parts.append(f"stopped {run.stops} times")
    if run.troubles:
        parts.append(f"{len(run.troubles)} commands failed or refused")
    return "; ".join(parts)
