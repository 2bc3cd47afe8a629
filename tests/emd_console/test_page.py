"""The console's pages in a real browser, at a cell that obeys at once."""

import json
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import browser_page
import cv2
import numpy as np
import pytest
from fake_cell import FakeCell, example, flat_grid

from emd_arm_executor.hiro.description import OBSERVE, URDF_PATH, transform_camera_to_table
from emd_console.access import AccessPolicy, Tokens
from emd_console.cell_state import CellState
from emd_console.command_log import CommandLog
from emd_console.desk import Desk
from emd_console.example_store import ExampleStore
from emd_console.health import report_from_status
from emd_console.operator_lease import OperatorLease
from emd_console.port import free_port
from emd_console.robot_view import RobotView
from emd_console.sections import sections
from emd_console.web.console import Console
from emd_console.web.live import LiveFeed
from emd_core.pinhole_camera import PinholeCamera

OPERATOR, VIEWER = "operator-of-the-test", "viewer-of-the-test"
HEAD = OBSERVE.by_joint()
CORNERS = [[181, 102], [168, 389], [471, 389], [458, 102]]
Open = Callable[..., Any]


class Served:
    """A console that is served from a thread, with a cell of our own behind it."""

    def __init__(self, folder: Path) -> None:
        """Begin to serve."""
        from emd_console.web.server import make_app, make_server

        port = free_port("127.0.0.1", 8870)
        self.folder = folder
        self.cell = FakeCell()
        self.state = CellState()
        self.desk = Desk(self.cell, ExampleStore(folder / "examples"))
        self.pictures = 1
        feed = LiveFeed(
            self.state,
            lambda: sections(self.state, self.desk),
            picture,
            lambda: self.pictures,
            15.0,
        )
        self.console = Console(
            self.state,
            self.desk,
            OperatorLease(),
            CommandLog(folder / "commands.jsonl"),
            self.desk.store,
            AccessPolicy("127.0.0.1", port, Tokens(OPERATOR, VIEWER)),
            feed,
        )
        self.address = f"http://127.0.0.1:{port}/"
        self._server = make_server(make_app(self.console), "127.0.0.1", port)
        self._thread = threading.Thread(target=self._server.run, daemon=True)
        self._thread.start()
        browser_page.wait_for_port(port, lambda: None)
        self.fresh()

    def fresh(self) -> None:
        """A flat cloth, nodes that live, nobody in command, nothing planned."""
        self.cell.__init__()  # type: ignore[misc]
        self.console.lease.__init__()  # type: ignore[misc]
        self.desk.goal = self.desk.proposal = self.desk.seen = None
        self.desk.message, self.desk.failed = "", False
        self.desk.lesson.clear()
        self.state.update(
            camera=PinholeCamera(),
            transform_camera_to_table=transform_camera_to_table(
                HEAD["HEAD_JOINT0"], HEAD["HEAD_JOINT1"]
            ),
            outlines=(CORNERS,),
            grid=flat_grid(),
            robot=RobotView(URDF_PATH.read_text()),
            joints=HEAD,
        )
        for node in ("perception", "planner", "arm_executor"):
            self.hear(node)

    def hear(self, node: str, ago: float = -3600.0) -> None:
        """A node's report, by default one that stays fresh during a test."""
        report = report_from_status(f"{node}: x", 0, "ready", node, time.monotonic() - ago)
        self.state.report(report)

    def stop(self) -> None:
        """Serve no longer."""
        self._server.should_exit = True
        self._thread.join(10)


def picture() -> np.ndarray:
    """A blue cloth on a brown table."""
    image = np.full((480, 640, 3), (170, 130, 85), dtype=np.uint8)
    cv2.fillPoly(image, [np.array(CORNERS)], (52, 98, 180))
    return image


@pytest.fixture(scope="module")
def served(tmp_path_factory) -> Iterator[Served]:
    """A served console; NiceGUI has one a process."""
    browser_page.require_chromium()
    made = Served(Path(tmp_path_factory.mktemp("console")))
    yield made
    made.stop()


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A headless chromium that draws nothing in 3D."""
    with browser_page.chromium(scene=False) as started:
        yield started


@pytest.fixture
def open_page(browser, served) -> Iterator[Open]:
    """Opens pages, as visitors of their own."""
    opened: list[Any] = []
    served.fresh()

    def visit(token: str, path: str = "") -> Any:
        link = f"{served.address}{path}?token={token}"
        opened.append(browser_page.ConsolePage(browser, link, browser_page.LAPTOP))
        return opened[-1]

    yield visit
    for page in opened:
        page.close()


def test_teach_execute_and_review(open_page, served) -> None:
    """Dragged, checked, executed, recorded, accepted: with the mouse and with keys."""
    page = open_page(OPERATOR)
    page.wait_for_picture()
    page.press("t")
    page.drag((190, 115), (180, 380))
    assert "can do this" in page.wait_for_message("can do this")
    page.click_picture(450, 115)
    page.page.wait_for_function("page.sections.overlay.lesson.grasps.length == 2")
    page.press("r")
    assert "recorded as example" in page.wait_for_message("recorded")
    assert served.cell.calls.count("execute") == 1
    page.screenshot("page_taught")
    page.page.goto(served.address + "review")
    page.page.wait_for_selector("article.example")
    page.page.get_by_text("Accept", exact=True).first.click()
    page.page.wait_for_selector("article.example.accepted")
    page.screenshot("page_review")
    assert served.desk.store.all()[0].review.verdict == "accepted"
    assert [text for text in page.errors if "WebGL" not in text] == []


def test_a_grasp_is_turned_by_its_handle_and_by_keys(open_page, served) -> None:
    """Each turn is checked by the executor; what was asked goes into the recording."""
    page = open_page(OPERATOR)
    page.wait_for_picture()
    page.press("t")
    page.drag((190, 115), (180, 380))
    page.page.wait_for_function("page.sections.overlay.lesson.hands.length == 1")
    ((tail, grip),) = page.page.evaluate("page.sections.overlay.lesson.hands")
    page.drag(tuple(tail), (grip[0] - 40, grip[1] - 40))
    page.page.wait_for_function("page.sections.overlay.lesson.hands[0][0][0] < 175")
    (dragged,) = served.desk.lesson.directions
    assert dragged[0] > 0.3 and dragged[1] > 0.3
    page.screenshot("page_grasp_turned")
    page.press(",")
    page.page.wait_for_function(f"page.sections.overlay.lesson.hands[0][0][1] < {grip[1] - 25}")
    (turned,) = served.desk.lesson.directions
    assert np.isclose(dragged @ turned, np.cos(np.deg2rad(10)))
    page.wait_until_enabled("r")
    page.press("r")
    page.wait_for_message("recorded")
    entry = served.desk.store.all()[0].entry
    assert np.allclose(entry["planned"]["grasp_directions"][0], turned)
    assert entry["planned"]["grasp_directions"][1] is None
    assert served.cell.calls.count("check") == 3


def test_history_shows_each_run_and_gives_its_report(open_page, served, tmp_path) -> None:
    """For a viewer, too: pictures on the page, and a file to keep."""
    served.desk.store.add(example("planned"))
    page = open_page(VIEWER, "history")
    page.page.wait_for_selector("article.run")
    page.page.wait_for_function(
        "[...document.querySelectorAll('.strip img')].every(i => i.complete && i.naturalWidth > 0)"
    )
    page.screenshot("page_history")
    with page.page.expect_download() as download:
        page.page.get_by_text("Report", exact=True).first.click()
    download.value.save_as(tmp_path / "report.html")
    report = page.context.new_page()
    report.goto(f"file://{tmp_path}/report.html")
    assert report.evaluate("[...document.images].every(i => i.naturalWidth > 0)")
    assert report.locator(".fold").count() == len(served.desk.store.all())
    report.screenshot(path=browser_page.SCREENSHOTS / "report.png", full_page=True)
    assert page.errors == []


def test_a_recorded_motion_is_replayed(open_page, served) -> None:
    """Stepped by keys, played to its end; its size and duration stand on the review page."""
    number = served.desk.store.add(example()).number
    page = open_page(VIEWER, "review")
    page.page.wait_for_selector("article.example")
    assert "motion 2 s, bag 0." in page.page.locator(".motion").first.inner_text()
    page.page.goto(f"{served.address}replay/{number}")
    moment = "text => document.getElementById('moment')?.textContent.includes(text)"
    page.page.wait_for_function(moment, arg="0.0 of 2.0 s approach")
    page.page.keyboard.press("ArrowRight")
    page.page.wait_for_function(moment, arg="0.1 of 2.0 s approach")
    page.page.keyboard.press(" ")
    page.page.wait_for_function(moment, arg="2.0 of 2.0 s home")
    page.screenshot("page_replay")
    with page.page.expect_download() as download:
        page.page.get_by_text("Bag (MCAP)").click()
    assert download.value.suggested_filename == f"example_{number:05d}.mcap"
    page.page.goto(f"{served.address}replay/7777")
    page.page.get_by_text("there is no example 7777").wait_for()
    assert [text for text in page.errors if "WebGL" not in text] == []


def test_plan_then_accept(open_page, served) -> None:
    """Nothing moves before the operator accepts, by keys alone."""
    page = open_page(OPERATOR)
    page.wait_for_picture()
    page.page.focus('[data-goal="diagonal"]')
    page.page.keyboard.press("Enter")
    page.press("p")
    assert "is ready" in page.wait_for_message("is ready")
    page.page.wait_for_function(
        "document.getElementById('trust').textContent.includes('not known')"
    )
    page.screenshot("page_plan")
    assert "execute" not in served.cell.calls
    page.press("e")
    assert "recorded as example" in page.wait_for_message("recorded")


def test_stop_by_escape(open_page, served) -> None:
    """From anywhere on the page."""
    page = open_page(OPERATOR)
    page.wait_for_picture()
    served.cell.slow = True
    page.page.click('[data-goal="half"]')
    page.press("p")
    page.wait_for_message("is ready")
    page.press("e")
    page.wait_for_status("folding")
    page.page.keyboard.press("Escape")
    assert "stopped" in page.wait_for_message("stopped")
    assert served.cell.calls[-1] == "stop"


def test_a_viewer_sees_everything_and_can_move_nothing(open_page, served) -> None:
    """No button works, and an event forged in the page's scripts does neither."""
    page = open_page(VIEWER)
    page.wait_for_picture()
    for key in "lpernw":
        assert page.page.locator(f'[data-key="{key}"]').first.is_disabled()
    page.page.keyboard.press("t")
    page.drag((190, 115), (180, 380))
    page.page.evaluate("emitEvent('teach_drag', {points: [[200, 110], [200, 380]]})")
    page.page.get_by_text("viewers only look").first.wait_for()
    page.page.keyboard.press("Escape")
    page.page.wait_for_timeout(500)
    page.screenshot("page_viewer")
    assert served.cell.calls == [] and served.desk.lesson.release is None


def test_the_picture_is_there_before_the_framework(browser, served, open_page) -> None:
    """Even if that never comes; once it is there, the same canvas stands in its place."""
    context = browser.new_context(viewport=browser_page.LAPTOP)
    page = context.new_page()
    page.route("**/quasar.umd*", lambda route: None)  # never answered
    page.goto(f"{served.address}?token={OPERATOR}", wait_until="commit")
    page.wait_for_function("document.getElementById('picture-note')?.hidden")
    assert page.locator("#stop").count() == 0
    page.screenshot(path=browser_page.SCREENSHOTS / "page_early.png")
    context.close()
    whole = open_page(OPERATOR)
    whole.page.wait_for_selector("#folds")
    assert whole.page.locator("#early").count() == 0
    assert whole.page.locator("#screen #picture").count() == 1


def test_a_wrong_token_sees_nothing(open_page) -> None:
    """Not a word about the cell."""
    page = open_page("wrong-token-of-the-test")
    assert page.answer.status == 401
    assert "robot" not in page.page.content() and page.page.locator("canvas").count() == 0


def test_a_second_operator_waits_until_the_first_hands_over(open_page) -> None:
    """The first is asked, and consents."""
    first = open_page(OPERATOR)
    first.wait_for_picture()
    second = open_page(OPERATOR)
    second.wait_for_picture()
    assert second.page.locator('[data-key="l"]').is_disabled()
    second.page.get_by_text("Take command").click()
    first.page.get_by_text("Hand over").click()
    second.wait_until_enabled("l")
    first.page.wait_for_selector('[data-key="l"][disabled]')
    first.screenshot("page_handed_over")


def test_a_silent_node_is_named_and_its_return_too(open_page, served) -> None:
    """On the tab, and in its list."""
    page = open_page(OPERATOR)
    page.wait_for_picture()
    served.hear("planner", ago=60.0)
    page.page.wait_for_selector('[data-tab="nodes"].alarm')
    page.page.click('[data-tab="nodes"]')
    assert "planner" in page.page.inner_text("li.silent")
    page.screenshot("page_silent")
    served.hear("planner")
    page.page.wait_for_selector('[data-tab="nodes"]:not(.alarm)')


def test_malformed_requests_and_messages_change_nothing(open_page, served) -> None:
    """Two hundred of them: no traceback, nothing asked of the cell, and the page goes on."""
    page = open_page(OPERATOR)
    page.wait_for_picture()
    answers = browser_page.malformed(served.address, OPERATOR, 200)
    assert len(answers) == 200
    assert not any("Traceback" in answer or "root:" in answer for answer in answers)
    for points in ("[]", "[[1]]", '["a", null]', "[[1e999, 2], [3, 4]]", '{"x": 1}', "null"):
        page.page.evaluate(f"emitEvent('teach_drag', {{points: {points}}})")
        page.page.evaluate(f"emitEvent('teach_hand', {points})")
    page.page.wait_for_timeout(1000)
    assert served.cell.calls == []
    page.press("l")
    assert "cloth seen" in page.wait_for_message("cloth seen")
    done = [json.loads(line) for line in (served.folder / "commands.jsonl").open()]
    assert done[-1]["command"] == "look"


def test_a_foreign_page_gets_no_stream(served) -> None:
    """Not even with the operator's cookie."""
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect

    headers = {"Cookie": f"emd_console={OPERATOR}", "Origin": "http://evil.example"}
    for path in ("live", "_nicegui_ws/socket.io/?EIO=4&transport=websocket"):
        link = served.address.replace("http", "ws", 1) + path
        with pytest.raises(InvalidStatus):
            connect(link, additional_headers=headers)
