"""The operator's console in a real browser, on the simulated cell."""

import base64
import json
import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import browser_page
import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState

from emd_arm_executor.hiro.description import OBSERVE, transform_camera_to_table
from emd_cell.launcher import Launcher, NodeSpec
from emd_cell.nodes import console_node
from emd_cell.ros.cell_client import CellClient
from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.neat_folds import neat_fold
from emd_console.port import free_port
from emd_console.projection import TableProjection
from emd_console.replay import read_replay
from emd_core.frames import FieldOfView, FloatArray
from emd_core.metrics import voxel_mse
from emd_core.pinhole_camera import PinholeCamera
from emd_core.sequence_reader import SequenceReader
from emd_core.voxel_grid import VoxelGrid

pytestmark = pytest.mark.system

OPERATOR, VIEWER = "operator-of-the-test", "viewer-of-the-test"
HEAD = OBSERVE.by_joint()
PROJECTION = TableProjection(
    PinholeCamera(), transform_camera_to_table(HEAD["HEAD_JOINT0"], HEAD["HEAD_JOINT1"])
)

Open = Callable[..., Any]


def goal_of(name: str) -> VoxelGrid:
    """What a neat fold should look like."""
    return neat_fold(name, ClothConfig()).goal_grid(FieldOfView())


def pixel(x: float, y: float) -> tuple[float, float]:
    """Where a point of the table is in the picture."""
    column, row = PROJECTION.pixels(np.array([[x, y, 0.0]]))[0]
    return float(column), float(row)


def joints(client: CellClient) -> FloatArray:
    """Where the joints are from now on, radians."""
    heard: list[JointState] = []
    subscription = client.create_subscription(JointState, "joint_states", heard.append, 10)
    deadline = time.monotonic() + 60
    while not heard:
        assert time.monotonic() < deadline
        client._spin()
    client.destroy_subscription(subscription)
    return np.array(heard[-1].position)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A headless chromium, or a skip."""
    with browser_page.chromium() as started:
        yield started


@pytest.fixture(scope="module")
def recordings(tmp_path_factory) -> Path:
    """Where the console records."""
    return Path(tmp_path_factory.mktemp("console"))


@pytest.fixture(scope="module")
def address(browser, client, recordings) -> Iterator[str]:
    """A console with tokens at the running cell."""
    port = free_port("127.0.0.1", 8790)
    node = console_node("127.0.0.1", port, True, recordings)
    tokens = {"operator_token": OPERATOR, "viewer_token": VIEWER}
    spec = NodeSpec(node.name, node.module, {**node.parameters, **tokens})
    with Launcher([spec], recordings / "logs") as console:
        browser_page.wait_for_port(port, console.require_alive)
        yield f"http://127.0.0.1:{port}/"


@pytest.fixture
def open_page(browser, address) -> Iterator[Open]:
    """Opens pages, as visitors of their own."""
    opened: list[Any] = []

    def visit(token: str, path: str = "", size: Any = None, dark: bool = False) -> Any:
        link = f"{address}{path}?token={token}"
        page = browser_page.ConsolePage(browser, link, size or browser_page.LAPTOP, dark)
        opened.append(page)
        return page

    yield visit
    for page in opened:
        page.close()


@pytest.fixture
def operator(open_page, fresh_cloth) -> Any:
    """An operator's page that shows the cell."""
    page = open_page(OPERATOR)
    page.wait_for_picture()
    page.take_command()
    return page


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("size", ["LAPTOP", "TABLET"])
def test_the_page_loads_without_an_error_and_shows_the_cell(open_page, size, dark) -> None:
    """Picture, nodes and stop button are there, on a laptop and a tablet, light and dark."""
    page = open_page(OPERATOR, size=getattr(browser_page, size), dark=dark)
    page.wait_for_picture()
    page.wait_for_status("ready")
    page.page.wait_for_timeout(1500)
    page.screenshot(f"page_{size.lower()}_{'dark' if dark else 'light'}")
    assert page.errors == []
    assert page.page.locator("#stop").is_visible()
    assert "token" not in page.page.url


def test_a_half_fold_dragged_with_the_mouse_folds_the_cloth(operator, client, recordings) -> None:
    """Both hands are drawn and checked; what was done is on disk and on the review page."""
    before = voxel_mse(client.true_grid(), goal_of("half"))
    operator.press("t")
    operator.drag(pixel(-0.2, -0.2), pixel(0.2, -0.2))
    assert "can do this" in operator.wait_for_message("can do this")
    operator.click_picture(*pixel(-0.2, 0.2))
    assert "left and right" in operator.wait_for_message("left and right")
    operator.wait_until_enabled("r")
    operator.screenshot("teach_checked")
    operator.press("r")
    operator.wait_for_status("moving: carry", 300)
    operator.screenshot("teach_moving")
    assert "recorded as example 0" in operator.wait_for_message("recorded", 400)
    operator.screenshot("teach_done")
    assert voxel_mse(client.true_grid(), goal_of("half")) < 0.5 * before
    (sequence,) = SequenceReader([recordings / "examples" / "example_00000"])
    assert voxel_mse(VoxelGrid(sequence.grids[1]), goal_of("half")) < 0.5 * before
    operator.page.goto(operator.page.url + "review")
    operator.page.wait_for_selector("article.example")
    operator.page.get_by_text("Accept", exact=True).click()
    operator.page.wait_for_selector("article.example.accepted")
    operator.page.wait_for_timeout(800)
    operator.screenshot("review")
    operator.page.get_by_text("Replay", exact=True).click()
    moment = "text => document.getElementById('moment')?.textContent.includes(text)"
    operator.page.wait_for_function(moment, arg="0.0 of ")
    operator.page.evaluate("window.page.show(Math.round(0.45 * window.page.last))")
    operator.page.wait_for_function(moment, arg=" s carry")
    operator.page.wait_for_timeout(3000)
    operator.screenshot("replay")
    replay = read_replay(recordings / "examples/example_00000/motion")
    assert {"approach", "grasp", "carry", "release", "retreat", "home"} <= {
        name for _, name in replay.phases
    }
    with AnyReader([recordings / "examples/example_00000/motion"]) as bag:
        topics = {item.topic for item in bag.connections}
    assert {f"/{side}_arm_controller/joint_trajectory" for side in ("left", "right")} <= topics
    review = json.loads((recordings / "examples/example_00000/review.json").read_text())
    assert review["verdict"] == "accepted"


def test_the_diagonal_of_the_gallery_is_planned_and_executed(operator, client) -> None:
    """The prediction and its trust figure are shown before anything moves."""
    before = client.true_grid()
    operator.page.click('[data-goal="diagonal"]')
    operator.press("p")
    assert "is ready" in operator.wait_for_message("is ready", 400)
    operator.page.wait_for_timeout(1000)
    operator.screenshot("plan")
    assert "expected" in operator.page.inner_text("#trust")
    assert (client.true_grid().occupancy == before.occupancy).all()
    operator.press("e")
    assert "recorded as example" in operator.wait_for_message("recorded", 400)
    operator.page.wait_for_timeout(1000)
    operator.screenshot("plan_done")
    operator.page.goto(operator.page.url + "history")
    operator.page.wait_for_selector("article.run img")
    operator.page.wait_for_timeout(1000)
    operator.screenshot("history")
    goal = goal_of("diagonal")
    assert voxel_mse(client.true_grid(), goal) < voxel_mse(before, goal)


def test_what_a_drag_would_give_becomes_the_goal(operator, client) -> None:
    """The simulated copy is folded, the cloth itself and the arms stay as they are."""
    before, at_rest = client.true_grid(), joints(client)
    operator.press("t")
    operator.drag(pixel(-0.2, 0.2), pixel(0.0, 0.0))
    operator.wait_for_message("can do this")
    operator.press("w")
    assert "is the goal now" in operator.wait_for_message("the goal now")
    operator.page.wait_for_timeout(1000)
    operator.screenshot("what_if")
    heights = operator.page.evaluate("page.sections.grids.goal")
    counts = np.frombuffer(base64.b64decode(heights["data"]), np.uint8).reshape(32, 32)
    flat = before.occupancy.sum(axis=2)
    assert counts[5:9, 23:27].sum() < 0.3 * flat[5:9, 23:27].sum()  # the corner is gone from here
    assert counts.max() > flat.max()  # and lies on the rest
    assert (client.true_grid().occupancy == before.occupancy).all()
    assert np.allclose(joints(client), at_rest, atol=1e-3)


def test_stop_ends_a_motion(operator, client) -> None:
    """By the Escape key; the message says so and the arms are still."""
    operator.press("t")
    operator.drag(pixel(-0.2, -0.2), pixel(0.1, -0.2))
    operator.wait_for_message("can do this")
    operator.press("r")
    operator.wait_for_status("moving: approach", 200)
    operator.page.wait_for_timeout(1000)
    operator.page.keyboard.press("Escape")
    assert "stopped" in operator.wait_for_message("stopped")
    operator.screenshot("stopped")
    assert (client.true_grid().occupancy == client.true_grid().occupancy).all()
    client.go_home()


def test_a_killed_node_is_named_and_its_return_too(operator, launcher) -> None:
    """Killed with -9: the page says which one it is, and all is well once it runs again."""
    killed = launcher.process_id("planner")
    os.kill(killed, signal.SIGKILL)  # nobody looks after the nodes until `watch` is called
    operator.page.click('[data-tab="nodes"]')
    operator.page.wait_for_selector("li.silent", timeout=60_000)
    operator.screenshot("node_silent")
    assert "planner" in operator.page.inner_text("li.silent")
    assert operator.page.locator("li.silent").count() == 1
    deadline = time.monotonic() + 180
    while operator.page.locator('[data-tab="nodes"].alarm').count():
        launcher.require_alive()  # starts the dead one again
        assert time.monotonic() < deadline
        operator.page.wait_for_timeout(200)
    operator.screenshot("node_back")
    assert launcher.process_id("planner") != killed
    assert operator.page.locator("li.ok, li.warning").count() >= 3
    operator.page.click('[data-tab="robot"]')


def test_a_viewer_moves_nothing(open_page, client, fresh_cloth, recordings) -> None:
    """Neither by mouse and keys nor by events forged in the page: no motion, no plan, no goal."""
    before = joints(client)
    viewer = open_page(VIEWER)
    viewer.wait_for_picture()
    viewer.wait_for_status("ready")
    commands = (recordings / "commands.jsonl").read_text().splitlines()
    viewer.page.click('[data-goal="half"]')
    for key in "ltpaernx":
        assert viewer.page.locator(f'[data-key="{key}"]:not([disabled])').count() <= (key == "t")
        viewer.page.keyboard.press(key)
    viewer.drag(pixel(-0.2, -0.2), pixel(0.2, -0.2))
    points = [list(pixel(-0.2, -0.2)), list(pixel(0.2, -0.2))]
    viewer.page.evaluate(f"emitEvent('teach_drag', {{points: {points}}})")
    viewer.page.evaluate("document.querySelectorAll('button').forEach(b => b.disabled = false)")
    for name in ("Look", "Execute taught", "Arms home", "New cloth"):
        viewer.page.get_by_text(name, exact=True).click(force=True)
    viewer.page.get_by_text("viewers only look").first.wait_for()
    viewer.page.wait_for_timeout(3000)
    viewer.screenshot("viewer")
    assert np.allclose(joints(client), before, atol=1e-3)
    new = [json.loads(line) for line in (recordings / "commands.jsonl").open()][len(commands) :]
    assert new and all(entry["outcome"].startswith("refused") for entry in new)
    status = viewer.page.evaluate("page.sections.status")
    assert not status["moving"] and not status["planning"] and not status["doing"]
