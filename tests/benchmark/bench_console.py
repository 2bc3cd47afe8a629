"""The operator's console: first view, pictures a second to ten viewers, stop, what viewers cost.

A simulated cell and a console run in a ROS domain of their own. First view, one viewer's pictures
and the stop are measured in a headless chromium, the stop until the joints' measured speeds are
below 0.02 rad/s. The ten viewers are sockets that take what a page takes: ten browsers would take
more of one machine than the cell itself. What they cost is measured side by side, several times in
turn, without a console, with one that nobody looks at, and with ten viewers: simulated seconds a
second of the wall clock (`pace`, 1 on an idle machine), the time of one and the same plan, and the
console's share of a core. Where other work disturbs pace and times, the last one tells more: a
cell that fills the whole processor is slowed by `processor_share_with_viewers`; the viewers here
take `cores_of_viewers` of the same machine, which they would not elsewhere. At last memory is
watched while ten viewers look, for `--minutes`.
"""

import asyncio
import os
import shutil
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from domain_coordinator import domain_id
from sensor_msgs.msg import CameraInfo, JointState
from websockets.asyncio.client import connect

from emd_cell.bench import BenchmarkResult
from emd_cell.large_messages import use_large_messages
from emd_cell.launcher import Launcher
from emd_cell.nodes import cell_nodes, console_node
from emd_cell.process_figures import cpu_seconds, descendants, memory_mb
from emd_cell.ros.cell_client import CellClient
from emd_console.goals import neat_goal
from emd_console.port import free_port
from emd_core.errors import InvalidInputError
from emd_core.manipulation import Manipulation
from emd_core.ros import conversions
from emd_core.voxel_grid import VoxelGrid
from emd_msgs_py.action import ExecuteManipulation

VIEWERS = 10
ROUNDS = 3
SECONDS = 8.0
PLANS = 4
MINUTES = 2.0
STILL = 0.02  # rad/s
STOPS = 3
VIEWS = 3
SETTLING = 30.0  # seconds
ONE_HAND = Manipulation([[-0.2, -0.2], [float("nan")] * 2], [0.15, 0.15])  # type: ignore[arg-type]


def run(minutes: float = MINUTES) -> BenchmarkResult:
    """Start the cell, measure, stop it.

    Args:
        minutes: For which memory is watched.

    Raises:
        InvalidInputError: If there is no chromium.
    """
    executable = _chromium()
    use_large_messages()
    with domain_id() as number, tempfile.TemporaryDirectory() as folder:
        os.environ["ROS_DOMAIN_ID"] = str(number)
        with Launcher(cell_nodes(overview=False), Path(folder) / "cell") as cell:
            rclpy.init()
            client = CellClient(on_spin=cell.require_alive)
            try:
                client.wait_for_cell(simulated=True)
                return _measure(client, Path(folder), executable, minutes)
            finally:
                client.destroy_node()
                rclpy.try_shutdown()


def _measure(client: CellClient, folder: Path, executable: str, minutes: float) -> BenchmarkResult:
    rows: list[dict[str, Any]] = []
    start = client.capture().grid
    for number in range(ROUNDS):
        rows.append({"viewers": None, **_work(client, start)})
        with _console(folder / f"console{number}") as (address, console):
            rows.append({"viewers": 0, **_with_share(console, lambda: _work(client, start))})
            watch = partial(_watch, address, partial(_work, client, start))
            watched = _with_share(console, lambda: asyncio.run(watch()))  # noqa: B023 (at once)
            rows.append({"viewers": VIEWERS, **watched})
    with _console(folder / "views") as (address, console):
        seen = _in_browser(client, f"http://{address}/", executable, console)
        memory = asyncio.run(_watch(address, partial(_memory_row, console, minutes)))
    summary = {
        **{key: statistics.median(view[key] for view in seen.views) for key in seen.new_view},
        "first_view_new_browser_s": seen.new_view["first_view_s"],
        "camera_fps": statistics.median(row["fps"] for row in rows if "fps" in row),
        "browser_fps": seen.fps,
        "stop_s": statistics.median(stop["stop_wall_s"] for stop in seen.stops),
        "stop_robot_s": statistics.median(stop["stop_robot_s"] for stop in seen.stops),
        **_costs(rows),
        "memory_growth_mb": memory["growth_mb"],
        "memory_mb_an_hour": memory["mb_an_hour"],
    }
    config = {
        "viewers": VIEWERS,
        "rounds": ROUNDS,
        "seconds": SECONDS,
        "plans": PLANS,
        "minutes": minutes,
        "still": STILL,
    }
    return BenchmarkResult(config, [*rows, *seen.views, *seen.stops, memory], summary)


def _costs(rows: list[dict[str, Any]]) -> dict[str, float]:
    """What a console and its viewers cost the cell, as ratios of medians."""

    def median(viewers: int | None, key: str) -> float:
        return statistics.median(row[key] for row in rows if row["viewers"] == viewers)

    return {
        "published_fps": median(VIEWERS, "published_fps"),
        "pace_with_console_over_without": median(0, "pace") / median(None, "pace"),
        "pace_with_viewers_over_without": median(VIEWERS, "pace") / median(None, "pace"),
        "plan_time_with_console_over_without": median(0, "plan_s") / median(None, "plan_s"),
        "plan_time_with_viewers_over_without": median(VIEWERS, "plan_s") / median(None, "plan_s"),
        "cores_of_viewers": median(VIEWERS, "benchmark_cores") - median(0, "benchmark_cores"),
        "cores_with_console": median(0, "cores"),
        "cores_with_viewers": median(VIEWERS, "cores"),
        "processor_share_with_viewers": median(VIEWERS, "cores") / (os.cpu_count() or 1),
    }


def _work(client: CellClient, start: VoxelGrid) -> dict[str, float]:
    """The simulation's pace, the seconds of one and the same plan, and what we take meanwhile."""
    begun, used = time.monotonic(), time.process_time()
    pace = _pace(client, SECONDS)
    goal = neat_goal("diagonal").grid
    seconds = [client.plan(start, goal, 1, seed=0).planning_ms / 1e3 for _ in range(PLANS)]
    ours = (time.process_time() - used) / (time.monotonic() - begun)
    return {**pace, "plan_s": statistics.median(seconds), "benchmark_cores": ours}


def _with_share(process: int, measure: Callable[[], dict[str, float]]) -> dict[str, float]:
    """Measure, and add the share of a core that a process takes meanwhile."""
    begun, used = time.monotonic(), cpu_seconds(process)
    row = measure()
    return {**row, "cores": (cpu_seconds(process) - used) / (time.monotonic() - begun)}


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


async def _watch(address: str, measure: Callable[[], dict[str, float]]) -> dict[str, float]:
    """Measure while all viewers look; adds the pictures a second that the worst of them gets."""
    over = asyncio.Event()
    viewers = [asyncio.create_task(_view(address, over)) for _ in range(VIEWERS)]
    row = await asyncio.to_thread(measure)
    over.set()
    return {**row, "fps": min(await asyncio.gather(*viewers))}


async def _view(address: str, over: asyncio.Event) -> float:
    """Pictures a second that one viewer gets."""
    count, begun = 0, time.monotonic()
    async with connect(f"ws://{address}/live") as socket:
        while not over.is_set():
            if _is_picture(await asyncio.wait_for(socket.recv(), 30)):
                count += 1
                await socket.send("next")
    return count / (time.monotonic() - begun)


def _is_picture(message: str | bytes) -> bool:
    return isinstance(message, bytes) and message[:1] == b"\x01"


def _pace(client: CellClient, seconds: float) -> dict[str, float]:
    """Simulated seconds a second, and the camera's pictures a second, by stamps and counts."""
    stamps: list[float] = []
    pictures: list[CameraInfo] = []

    def take(message: JointState) -> None:
        stamps.append(conversions.time_from_message(message.header.stamp))

    heard = [
        client.create_subscription(JointState, "joint_states", take, 10),
        client.create_subscription(CameraInfo, "camera/color/camera_info", pictures.append, 10),
    ]
    started = time.monotonic()
    while time.monotonic() < started + seconds:
        client._spin()
    for item in heard:
        client.destroy_subscription(item)
    elapsed = time.monotonic() - started
    return {"pace": (stamps[-1] - stamps[0]) / elapsed, "published_fps": len(pictures) / elapsed}


@dataclass(frozen=True)
class _Seen:
    """What a browser saw.

    Attributes:
        new_view: The first view of a browser that has nothing in its cache.
        views: The following ones: seconds, and processor seconds of browser and console.
        fps: Pictures a second on the page.
        stops: Seconds from the stop key to arms that are still.
    """

    new_view: dict[str, float]
    views: list[dict[str, float]]
    fps: float
    stops: list[dict[str, float]]


def _chromium() -> str:
    executable = shutil.which("chromium")
    if executable is None:
        raise InvalidInputError("chromium is needed (Debian: apt-get install chromium)")
    return executable


def _in_browser(client: CellClient, link: str, executable: str, console: int) -> _Seen:
    """First views, pictures a second, and stops by the page's key, in a headless chromium."""
    from playwright.sync_api import sync_playwright

    others = set(descendants(os.getpid())) - {console}

    def take() -> dict[int, float]:
        ours = {console, *descendants(os.getpid())} - others
        return {process: cpu_seconds(process) for process in ours}

    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=executable, args=["--no-sandbox"])
        page = browser.new_page()
        page.set_default_timeout(120_000)
        views = [_first_view(page, link, take) for _ in range(1 + VIEWS)]
        fps = _page_fps(page)
        stops = [_stop(client, page) for _ in range(STOPS)]
        browser.close()
    return _Seen(views[0], views[1:], fps, stops)


def _first_view(page: Any, link: str, take: Callable[[], dict[int, float]]) -> dict[str, float]:
    """From the address to the camera's picture on the page, and what it took of the processor."""
    before, started = take(), time.monotonic()
    page.goto(link, wait_until="commit")
    page.wait_for_function("document.getElementById('picture-note')?.hidden")
    wall, after = time.monotonic() - started, take()
    page.wait_for_timeout(3000)  # until the robot is drawn, too
    taken = sum(used - before.get(process, 0.0) for process, used in after.items())
    return {"first_view_s": wall, "first_view_cpu_s": taken}


def _page_fps(page: Any) -> float:
    """Pictures a second that are drawn on the page."""
    begun, before = time.monotonic(), page.evaluate("window.page.camera.picture.shown")
    page.wait_for_timeout(1e3 * SECONDS)
    shown = page.evaluate("window.page.camera.picture.shown") - before
    return float(shown) / (time.monotonic() - begun)


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


def _memory_row(process: int, minutes: float) -> dict[str, float]:
    """Watch a process's memory, after the half minute in which its viewers have come."""
    time.sleep(SETTLING)
    begun = time.monotonic()
    times, sizes = [0.0], [memory_mb(process)]
    while times[-1] < 60.0 * minutes:
        time.sleep(min(5.0, 60.0 * minutes))
        times.append(time.monotonic() - begun)
        sizes.append(memory_mb(process))
    slope = float(np.polyfit(times, sizes, 1)[0])
    return {
        "memory_mb": sizes[0],
        "growth_mb": sizes[-1] - sizes[0],
        "mb_an_hour": 3600.0 * slope,
        "watched_s": times[-1],
    }
