"""Serves the console's pages until it is told to stop."""

from __future__ import annotations

import logging

import uvicorn
from fastapi import FastAPI, Response, WebSocket
from nicegui import ui
from starlette.staticfiles import StaticFiles

from emd_console.goals import gallery
from emd_console.web.console import STATIC, Console
from emd_console.web.guard import Guard
from emd_console.web.history_page import add_history_page
from emd_console.web.main_page import add_main_page
from emd_console.web.replay_page import add_replay_page
from emd_console.web.review_page import add_review_page

_LARGEST_MESSAGE = 256 * 1024
_TITLE = "EMD cell"


def make_app(console: Console) -> FastAPI:
    """Build the application; one in a process, since NiceGUI keeps one."""
    gallery()  # folded once, before anybody waits for it
    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    app.mount("/static", StaticFiles(directory=STATIC))
    _add_stream(app, console)
    _add_pictures(app, console)
    add_main_page(console)
    add_review_page(console)
    add_history_page(console, app)
    add_replay_page(console, app)
    ui.run_with(
        app,
        title=_TITLE,
        favicon=STATIC / "icon.svg",
        tailwind=False,
        reconnect_timeout=10.0,
        show_welcome_message=False,
    )
    app.add_middleware(Guard, policy=console.policy)  # last added, first asked
    return app


def _add_stream(app: FastAPI, console: Console) -> None:
    @app.websocket("/live")
    async def live(socket: WebSocket) -> None:
        await console.feed.serve(socket)


def _add_pictures(app: FastAPI, console: Console) -> None:
    @app.get("/examples/{number:int}/{moment}.jpg")
    def picture(number: int, moment: str) -> Response:
        content = console.store.picture(number, moment)
        if content is None:
            return Response("there is no such picture\n", 404, media_type="text/plain")
        return Response(content, media_type="image/jpeg")


def make_server(app: FastAPI, host: str, port: int) -> uvicorn.Server:
    """Prepare to serve; `run()` then serves until Ctrl-C."""
    logging.getLogger("websockets").setLevel(logging.ERROR)
    config = uvicorn.Config(
        app,
        host=host,
        port=port,
        log_level="warning",
        access_log=False,
        ws_max_size=_LARGEST_MESSAGE,
        ws_per_message_deflate=False,
        timeout_graceful_shutdown=2,
    )
    return uvicorn.Server(config)
