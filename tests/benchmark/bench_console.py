"""The operator's console: first view, pictures a second to ten viewers, stop, what viewers cost.

A simulated cell and a console run in a ROS domain of their own. First view and stop are measured
in a headless chromium, the stop until the joints' measured speeds are below 0.02 rad/s. The ten
viewers are sockets that take what a page takes. What they cost is measured side by side: simulated
seconds a second of the wall clock without a console, with one that nobody looks at, and with ten
viewers, several times in turn. A machine that is busy otherwise shows in `pace`, which is 1 on an
idle one.
"""

import asyncio
import os
import shutil
import statistics
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import rclpy
from domain_coordinator import domain_id
from sensor_msgs.msg import JointState
from websockets.asyncio.client import connect

from emd_cell.bench import BenchmarkResult
from emd_cell.launcher import Launcher
from emd_cell.nodes import cell_nodes, console_node
from emd_cell.ros.cell_client import CellClient
from emd_console.port import free_port
from emd_core.errors import InvalidInputError
from emd_core.manipulation import Manipulation
from emd_core.ros import conversions
from emd_msgs_py.action import ExecuteManipulation

VIEWERS = 10
ROUNDS = 2
SECONDS = 8.0
STILL = 0.02  # rad/s
STOPS = 3
ONE_HAND = Manipulation([[-0.2, -0.2], [float("nan")] * 2], [0.15, 0.15])  # type: ignore[arg-type]


def run() -> BenchmarkResult:
    """Start the cell, measure, stop it."""
    with domain_id() as number, tempfile.TemporaryDirectory() as folder:
        os.environ["ROS_DOMAIN_ID"] = str(number)
        with Launcher(cell_nodes(overview=False), Path(folder) / "cell") as cell:
            rclpy.init()
            client = CellClient(on_spin=cell.require_alive)
            try:
                client.wait_for_cell(simulated=True)
                return _measure(client, Path(folder))
            finally:
                client.destroy_node()
                rclpy.try_shutdown()


def _measure(client: CellClient, folder: Path) -> BenchmarkResult:
    rows: list[dict[str, Any]] = []
    for number in range(ROUNDS):
        rows.append({"viewers": None, **_pace(client, SECONDS)})
        with _console(folder / f"console{number}") as (address, console):
            rows.append({"viewers": 0, **_pace(client, SECONDS)})
            begun = _memory(console)
            watched = asyncio.run(_watch(client, address))
            rows.append(
                {"viewers": VIEWERS, **watched, "memory_growth_mb": _memory(console) - begun}
            )
    with _console(folder / "views") as (address, _):
        views, stops = _in_browser(client, f"http://{address}/")
    pace = {
        key: statistics.median(row["pace"] for row in rows if row["viewers"] == key)
        for key in (None, 0, VIEWERS)
    }
    summary = {
        "first_view_s": statistics.median(views),
        "camera_fps": statistics.median(row["fps"] for row in rows if "fps" in row),
        "camera_fps_of_the_camera": 10.0 * pace[VIEWERS],
        "stop_s": statistics.median(stop["stop_wall_s"] for stop in stops),
        "stop_robot_s": statistics.median(stop["stop_robot_s"] for stop in stops),
        "pace_with_console_over_without": pace[0] / pace[None],
        "pace_with_viewers_over_without": pace[VIEWERS] / pace[None],
    }
    config = {"viewers": VIEWERS, "rounds": ROUNDS, "seconds": SECONDS, "still": STILL}
    return BenchmarkResult(config, [*rows, *stops], summary)


@contextmanager
def _console(folder: Path) -> Iterator[tuple[str, int]]:
    """A console of its own: its address and process."""
    port = free_port("127.0.0.1", 8850)
    node = console_node("127.0.0.1", port, False, folder)
    with Launcher([node], folder / "logs") as console:
        address = f"127.0.0.1:{port}"
        deadline = time.monotonic() + 120
        while True:
            console.require_alive()
            try:
                asyncio.run(_first_picture(address))
                break
            except OSError:
                if time.monotonic() > deadline:
                    raise
                time.sleep(0.5)
        yield address, console.process_id(node.name)


async def _first_picture(address: str) -> None:
    """Wait until the stream has given a picture."""
    async with connect(f"ws://{address}/live") as socket:
        while not _is_picture(await asyncio.wait_for(socket.recv(), 60)):
            pass


async def _watch(client: CellClient, address: str) -> dict[str, Any]:
    """Simulated time and pictures while all viewers look."""
    viewers = [asyncio.create_task(_view(address)) for _ in range(VIEWERS)]
    pace = await asyncio.to_thread(_pace, client, SECONDS)
    counts = await asyncio.gather(*viewers)
    return {**pace, "fps": min(counts) / SECONDS}


async def _view(address: str) -> int:
    """Count the pictures that one viewer gets."""
    count, ends = 0, time.monotonic() + SECONDS
    async with connect(f"ws://{address}/live") as socket:
        while time.monotonic() < ends:
            if _is_picture(await asyncio.wait_for(socket.recv(), 30)):
                count += 1
                await socket.send("next")
    return count


def _is_picture(message: str | bytes) -> bool:
    return isinstance(message, bytes) and message[:1] == b"\x01"


def _pace(client: CellClient, seconds: float) -> dict[str, float]:
    """Simulated seconds a second, by the stamps of joint_states."""
    stamps: list[float] = []

    def take(message: JointState) -> None:
        stamps.append(conversions.time_from_message(message.header.stamp))

    heard = client.create_subscription(JointState, "joint_states", take, 10)
    started = time.monotonic()
    while time.monotonic() < started + seconds:
        client._spin()
    client.destroy_subscription(heard)
    return {"pace": (stamps[-1] - stamps[0]) / (time.monotonic() - started)}


def _in_browser(client: CellClient, link: str) -> tuple[list[float], list[dict[str, float]]]:
    """First views, and stops by the page's key, in a headless chromium.

    Raises:
        InvalidInputError: If there is no chromium.
    """
    from playwright.sync_api import sync_playwright

    executable = shutil.which("chromium")
    if executable is None:
        raise InvalidInputError("chromium is needed (Debian: apt-get install chromium)")
    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=executable, args=["--no-sandbox"])
        page = browser.new_page()
        page.set_default_timeout(120_000)
        views = [_first_view(page, link) for _ in range(4)][1:]  # the first compiles the scripts
        stops = [_stop(client, page) for _ in range(STOPS)]
        browser.close()
    return views, stops


def _first_view(page: Any, link: str) -> float:
    """Seconds from the address to the camera's picture on the page."""
    started = time.monotonic()
    page.goto(link)
    page.wait_for_function("document.getElementById('picture-note')?.hidden")
    return time.monotonic() - started


def _stop(client: CellClient, page: Any) -> dict[str, float]:
    """Seconds from the stop key to arms that are still, of the wall and of the robot's clock."""
    client.reset_simulation()
    client.capture()
    header = conversions.header(0.0, conversions.TABLE_FRAME)
    goal = ExecuteManipulation.Goal(
        manipulation=conversions.manipulation_to_message(ONE_HAND, header)
    )
    states: list[JointState] = []
    heard = client.create_subscription(JointState, "joint_states", states.append, 10)
    handle = client.send_goal(client._execute, goal)
    while not states or _speed(states[-1]) < 0.3:
        client._spin()
    started, before = time.monotonic(), conversions.time_from_message(states[-1].header.stamp)
    page.keyboard.press("Escape")
    while _speed(states[-1]) > STILL:
        client._spin()
    wall, after = time.monotonic(), conversions.time_from_message(states[-1].header.stamp)
    client._wait(handle.get_result_async(), 120.0, "the end of the goal")
    client.destroy_subscription(heard)
    client.go_home()
    return {"stop_wall_s": wall - started, "stop_robot_s": after - before}


def _speed(state: JointState) -> float:
    arms = [
        abs(speed) for name, speed in zip(state.name, state.velocity, strict=True) if "ARM" in name
    ]
    return max(arms)


def _memory(process: int) -> float:
    """Resident memory, MB."""
    pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6
