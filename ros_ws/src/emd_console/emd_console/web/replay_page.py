"""The page on which a recorded motion is looked at again."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from fastapi import FastAPI, Response
from fastapi.responses import FileResponse, JSONResponse
from nicegui import ui
from starlette.requests import Request

from emd_console.example_store import StoredExample
from emd_console.motion import MOTION
from emd_console.replay import Replay, read_replay
from emd_console.sections import rounded, shapes
from emd_console.web.console import Console
from emd_console.web.frame import add_data, plain_page
from emd_console.web.main_page import open_session
from emd_console.web.review_page import motion_text, title_text
from emd_core.errors import InvalidInputError

_MISSING = "there is no such recording, or it has no bag of its motion\n"


def add_replay_page(console: Console, app: FastAPI) -> None:
    """Serve the page at `/replay/<number>`, and what it replays beside the pictures."""

    @ui.page("/replay/{number}", response_timeout=30.0)
    def replay_page(request: Request, number: int) -> None:
        session = open_session(console, request)
        plain_page(console, session, "replay")
        try:
            example = console.store.get(number)
        except InvalidInputError as err:
            ui.label(str(err)).classes("hint")
            return
        _show(example)
        add_data("REPLAY", {"number": number})

    @app.get("/examples/{number:int}/replay.json")
    def replay(number: int) -> Response:
        bag = console.store.motion(number)
        if bag is None:
            return Response(_MISSING, 404, media_type="text/plain")
        try:
            return JSONResponse(replay_data(read_replay(bag)))
        except InvalidInputError as err:
            return Response(f"{err}\n", 422, media_type="text/plain")

    @app.get("/examples/{number:int}/motion.mcap")
    def motion(number: int) -> Response:
        bag = console.store.motion(number)
        if bag is None:
            return Response(_MISSING, 404, media_type="text/plain")
        return FileResponse(bag / f"{MOTION}.mcap", filename=f"example_{number:05d}.mcap")


def replay_data(replay: Replay) -> dict[str, Any]:
    """A replay as JSON holds it; poses as base64 of little-endian float32."""
    poses = np.round(replay.poses, 4).astype("<f4")
    table = replay.transform_table_to_base
    return {
        "shapes": shapes(replay.shapes),
        "times": np.round(replay.times, 3).tolist(),
        "phases": [[round(time, 3), name] for time, name in replay.phases],
        "poses": base64.b64encode(poses.tobytes()).decode(),
        "table": None if table is None else rounded(table),
    }


def _show(example: StoredExample) -> None:
    number, entry = example.number, example.entry
    with ui.element("main").classes("review"):
        with ui.row().classes("review-head"):
            ui.label(title_text(example)).classes("title")
            ui.label(motion_text(entry.get("motion"))).classes("hint")
            ui.space()
            if entry.get("motion"):
                link = ui.link("Bag (MCAP)", f"/examples/{number}/motion.mcap").classes("nav")
                link.props("download")
        with ui.element("div").classes("replay"):
            with ui.element("section").classes("card"):
                ui.html(_PLAYER, sanitize=False)
            with ui.element("section").classes("card pair"):
                for moment in ("before", "after"):
                    ui.html(
                        f'<figure><img src="/examples/{number}/{moment}.jpg" alt="{moment}">'
                        f"<figcaption>{moment}</figcaption></figure>",
                        sanitize=False,
                    )


_PLAYER = """
<div id="robot"><canvas></canvas><p class="hint"></p></div>
<div class="player" id="replay">
  <button id="back" data-key="ArrowLeft" title="key ←" aria-label="one step back">‹</button>
  <button id="play" data-key=" " title="key space">Play</button>
  <button id="forth" data-key="ArrowRight" title="key →" aria-label="one step on">›</button>
  <input id="seek" type="range" min="0" value="0" step="1" aria-label="moment of the motion">
  <output id="moment"></output>
</div>
"""
