"""The live stream: pictures and sections to every page, over one socket each."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import time
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from starlette.websockets import WebSocket, WebSocketDisconnect

from emd_console.cell_state import CellState

_LOG = logging.getLogger(__name__)
_PERIOD = 0.2  # seconds between looks at what has changed
_POSE_PERIOD = 0.1
_QUALITY = 80
_MOST_VIEWERS = 32
_PICTURE, _POSES = b"\x01", b"\x02"
Picture = NDArray[np.uint8]


class LiveFeed:
    """Makes every picture and section once, however many look; nothing while nobody does.

    A page says "next" when it has shown a picture, and only then is sent a newer one: a slow page
    gets fewer pictures, never late ones.
    """

    def __init__(
        self,
        state: CellState,
        make_sections: Callable[[], dict[str, Any]],
        image: Callable[[], Picture | None],
        image_number: Callable[[], int],
        camera_rate: float,
    ) -> None:
        """Feed from a state.

        Args:
            state: Gives the robot's posture.
            make_sections: Gives all sections.
            image: Gives the newest picture, shape (H, W, 3).
            image_number: Counts the pictures, so that none is encoded twice.
            camera_rate: Pictures a second that a page is sent at most.
        """
        self._state = state
        self._make_sections = make_sections
        self._image = image
        self._image_number = image_number
        self._camera_period = 1.0 / camera_rate
        self._sections: dict[str, str] = {}
        self._poses = b""
        self._jpeg: tuple[int, bytes] = (0, b"")
        self._encoding = asyncio.Lock()
        self._made = -1e9
        self._posed = -1e9
        self.viewers = 0

    async def serve(self, socket: WebSocket) -> None:
        """Feed one page until it leaves."""
        if self.viewers >= _MOST_VIEWERS:
            await socket.close(1013, "too many pages look already")
            return
        await socket.accept()
        self.viewers += 1
        ready = asyncio.Event()
        ready.set()
        tasks = [
            asyncio.create_task(work)
            for work in (
                self._listen(socket, ready),
                self._send_pictures(socket, ready),
                self._send_sections(socket),
            )
        ]
        try:
            ended, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            _complain(ended)
        finally:
            self.viewers -= 1
            for task in tasks:
                task.cancel()
            with contextlib.suppress(Exception):
                await asyncio.gather(*tasks, return_exceptions=True)
                await socket.close()

    async def _listen(self, socket: WebSocket, ready: asyncio.Event) -> None:
        """Pages only ever say "next"; anything else ends the stream."""
        try:
            while await socket.receive_text() == "next":
                ready.set()
        except (WebSocketDisconnect, KeyError, RuntimeError):
            return

    async def _send_pictures(self, socket: WebSocket, ready: asyncio.Event) -> None:
        sent = 0
        while True:
            await ready.wait()
            started = time.monotonic()
            while self._image_number() == sent:
                await asyncio.sleep(0.02)
            number, jpeg = await self._encoded()
            sent = number
            if jpeg:
                ready.clear()
                await socket.send_bytes(_PICTURE + jpeg)
            await asyncio.sleep(max(0.0, started + self._camera_period - time.monotonic()))

    async def _send_sections(self, socket: WebSocket) -> None:
        sent: dict[str, str] = {}
        poses = b""
        while True:
            for name, text in self._current_sections().items():
                if sent.get(name) != text:
                    await socket.send_text(f'{{"{name}":{text}}}')
                    sent[name] = text
            if (newest := self._current_poses()) != poses:
                poses = newest
                await socket.send_bytes(_POSES + poses)
            await asyncio.sleep(_POSE_PERIOD)

    def _current_sections(self) -> dict[str, str]:
        if time.monotonic() - self._made > _PERIOD:
            made = self._make_sections()
            self._sections = {
                name: json.dumps(value, separators=(",", ":")) for name, value in made.items()
            }
            self._made = time.monotonic()
        return self._sections

    def _current_poses(self) -> bytes:
        """Poses of the robot's shapes, to a tenth of a millimetre, so that rest is rest."""
        now = self._state.snapshot
        if now.robot is not None and time.monotonic() - self._posed > _POSE_PERIOD:
            poses = np.round(now.robot.poses(now.joints), 4)
            self._poses = poses.astype("<f4").tobytes()
            self._posed = time.monotonic()
        return self._poses

    async def _encoded(self) -> tuple[int, bytes]:
        async with self._encoding:
            number = self._image_number()
            if number != self._jpeg[0]:
                self._jpeg = (number, await asyncio.to_thread(self._encode))
            return self._jpeg

    def _encode(self) -> bytes:
        picture = self._image()
        if picture is None:
            return b""
        bgr = cv2.cvtColor(picture, cv2.COLOR_RGB2BGR)  # a view [..., ::-1] is copied slowly
        good, data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
        return data.tobytes() if good else b""


def _complain(tasks: set[asyncio.Task[None]]) -> None:
    """Log why a stream ended, unless the page just left."""
    for task in tasks:
        error = task.exception()
        if error is not None and not isinstance(error, (WebSocketDisconnect, RuntimeError)):
            _LOG.error("a page's stream failed", exc_info=error)
