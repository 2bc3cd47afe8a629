"""A headless browser on the console's page."""

from __future__ import annotations

import random
import shutil
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

SCREENSHOTS = Path(__file__).parents[2] / "runs" / "screenshots"
LAPTOP = {"width": 1366, "height": 768}
TABLET = {"width": 820, "height": 1180}
_ARGUMENTS = ("--no-sandbox", "--disable-dev-shm-usage")


def require_chromium() -> str:
    """Path of Debian's chromium; skips the test where there is none."""
    found = shutil.which("chromium")
    if found is None:
        pytest.skip("no chromium on this machine (Debian: apt-get install chromium)")
    return found


@contextmanager
def chromium(scene: bool = True) -> Iterator[Any]:
    """A running browser; without `scene` it draws nothing in 3D, which takes long in software."""
    executable = require_chromium()
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    arguments = [*_ARGUMENTS, *([] if scene else ["--disable-3d-apis"])]
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=executable, args=arguments)
        try:
            yield browser
        finally:
            browser.close()


class ConsolePage:
    """The page as an operator uses it."""

    def __init__(self, browser: Any, link: str, size: dict[str, int], dark: bool = False) -> None:
        """Open the page in a browser context of its own, so that it is a visitor of its own."""
        scheme = "dark" if dark else "light"
        self.context = browser.new_context(viewport=size, color_scheme=scheme)
        self.context.set_default_timeout(120_000)  # another's work may keep the machine busy
        self.page = self.context.new_page()
        self.errors: list[str] = []
        self.page.on("pageerror", lambda err: self.errors.append(str(err)))
        self.page.on("console", self._on_console)
        self.answer = self.page.goto(link)

    def _on_console(self, message: Any) -> None:
        if message.type == "error":
            self.errors.append(message.text)

    def wait_for_picture(self, timeout: float = 60.0) -> None:
        """Wait until the camera's picture is shown."""
        script = "document.getElementById('picture-note')?.hidden"
        self.page.wait_for_function(script, timeout=timeout * 1e3)

    def wait_for_message(self, text: str, timeout: float = 240.0) -> str:
        """Wait until the last outcome holds a text; a failure is one at once."""
        script = """text => {
            const shown = document.getElementById('message');
            return shown.textContent.includes(text) || shown.className === 'failed';
        }"""
        self.page.wait_for_function(script, arg=text, timeout=timeout * 1e3)
        return str(self.page.inner_text("#message"))

    def wait_for_status(self, text: str, timeout: float = 120.0) -> None:
        """Wait until the state in the bar holds a text."""
        script = "text => document.getElementById('status').textContent.includes(text)"
        self.page.wait_for_function(script, arg=text, timeout=timeout * 1e3)

    def wait_until_enabled(self, key: str, timeout: float = 60.0) -> None:
        """Wait until the button of a key may be pressed."""
        self.page.wait_for_selector(f'[data-key="{key}"]:not([disabled])', timeout=timeout * 1e3)

    def press(self, key: str) -> None:
        """Press a key once its button is enabled."""
        self.wait_until_enabled(key)
        self.page.keyboard.press(key)

    def take_command(self) -> None:
        """Command the cell, which whoever had the page before has left."""
        take = self.page.get_by_text("Take command")
        if take.is_visible():
            take.click()
        self.wait_until_enabled("l")

    def click_picture(self, column: float, row: float) -> None:
        """Click a pixel of the camera's picture."""
        self.page.mouse.click(*self._place(column, row))

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Drag from one pixel of the camera's picture to another."""
        mouse = self.page.mouse
        mouse.move(*self._place(*start))
        mouse.down()
        mouse.move(*self._place((start[0] + end[0]) / 2, (start[1] + end[1]) / 2))
        mouse.move(*self._place(*end))
        mouse.up()

    def screenshot(self, name: str, full: bool = False) -> None:
        """Keep what is seen now in runs/screenshots."""
        SCREENSHOTS.mkdir(parents=True, exist_ok=True)
        self.page.screenshot(path=SCREENSHOTS / f"{name}.png", full_page=full)

    def close(self) -> None:
        """Leave."""
        self.context.close()

    def _place(self, column: float, row: float) -> tuple[float, float]:
        box = self.page.locator("#overlay").bounding_box()
        return (
            box["x"] + (column + 0.5) / 640 * box["width"],
            box["y"] + (row + 0.5) / 480 * box["height"],
        )


def wait_for_port(port: int, check: Callable[[], None], timeout: float = 120.0) -> None:
    """Wait until something listens on this machine."""
    deadline = time.monotonic() + timeout
    while True:
        check()
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        assert time.monotonic() < deadline, f"nothing listens on port {port}"
        time.sleep(0.2)


def malformed(address: str, token: str, count: int) -> list[str]:
    """Send nonsense to every door; gives what came back."""
    rng = random.Random(0)
    senders = (_bad_request, _bad_body, _bad_stream, _bad_event)
    return [senders[number % 4](address, token, rng) for number in range(count)]


def _raw(address: str, content: bytes) -> str:
    host, port = address.split("/")[2].split(":")
    with socket.create_connection((host, int(port)), timeout=10) as connection:
        connection.sendall(content)
        try:
            return connection.recv(1 << 16).decode("latin-1")
        except OSError as err:
            return str(err)


def _head(address: str, token: str, line: str, more: str = "") -> str:
    host = address.split("/")[2]
    return (
        f"{line}\r\nHost: {host}\r\nCookie: emd_console={token}\r\nConnection: close\r\n{more}\r\n"
    )


def _bad_request(address: str, token: str, rng: random.Random) -> str:
    path = rng.choice(
        ["/../../etc/passwd", "/static/../guard.py", "/examples/-1/before.jpg", "/%00", "//",
         "/examples/99999999999999999999/after.jpg", "/live", "/_nicegui_ws/socket.io/?EIO=9",
         "/" + "a" * 5000, "/_nicegui/client/x/upload/1", "/history/-1/report.html",
         "/history/99999999999999999999/report.html", "/history/..%2f0/report.html",
         "/replay/-1", "/replay/x",
         "/examples/7777/replay.json", "/examples/..%2f0/motion.mcap", "/replay/9" + "9" * 30]
    )  # fmt: skip
    method = rng.choice(["GET", "POST", "PUT", "DELETE", "BREW"])
    return _raw(address, _head(address, token, f"{method} {path} HTTP/1.1").encode())


def _bad_body(address: str, token: str, rng: random.Random) -> str:
    body = rng.randbytes(rng.randrange(1, 4000))
    length = rng.choice([str(len(body)), "-5", "999999999999", "x"])
    kind = rng.choice(["application/json", "multipart/form-data; boundary=x", "text/plain"])
    more = f"Content-Length: {length}\r\nContent-Type: {kind}\r\n"
    line = f"POST {rng.choice(['/', '/review', '/_nicegui_ws/socket.io/?EIO=4'])} HTTP/1.1"
    return _raw(address, _head(address, token, line, more).encode() + body)


def _bad_stream(address: str, token: str, rng: random.Random) -> str:
    return _socket(address + "live", token, [_nonsense(rng) for _ in range(3)])


def _bad_event(address: str, token: str, rng: random.Random) -> str:
    link = address + "_nicegui_ws/socket.io/?EIO=4&transport=websocket"
    return _socket(link, token, ["40", _nonsense(rng), '42["event",' + str(_nonsense(rng))])


def _nonsense(rng: random.Random) -> str | bytes:
    return rng.choice(
        [
            rng.randbytes(200), "", "next" * 500, "{" * 400, '42["event",{"client_id":7}]',
            '42["handshake",null]', '42["event",{}]', '42["javascript_response",[]]', "9" * 50,
            '42["event",{"client_id":"x","id":0,"listener_id":"y","args":[]}]',
        ]
    )  # fmt: skip


def _socket(link: str, token: str, messages: list[str | bytes]) -> str:
    from websockets.exceptions import WebSocketException
    from websockets.sync.client import connect

    heard = ""
    try:
        with connect(
            link.replace("http", "ws", 1),
            additional_headers={"Cookie": f"emd_console={token}"},
            open_timeout=20,
            close_timeout=2,
        ) as connection:
            for message in messages:
                connection.send(message)
                with suppress(TimeoutError):
                    heard += str(connection.recv(timeout=0.05))[:2000]
    except (WebSocketException, OSError, TimeoutError) as err:
        heard += str(err)
    return heard
