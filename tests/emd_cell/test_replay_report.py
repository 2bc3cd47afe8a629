"""The replay's clock, its contact sheet and its report."""

import json

import cv2
import numpy as np
import pytest

from emd_cell.replay_clock import ReplayClock
from emd_cell.replay_summary import ContactSheet, ReplaySummary
from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView
from emd_core.voxel_grid import VoxelGrid

SECOND = 1_000_000_000


class Time:
    """A clock on which waiting costs no time."""

    now = 0.0

    def sleep(self, seconds: float) -> None:
        """Wait."""
        self.now += seconds


def play(rate: float, stamps: list[float]) -> tuple[Time, ReplayClock, list[float]]:
    """Pass through stamps in seconds; gives the jumps."""
    time = Time()
    clock = ReplayClock(rate, lambda: time.now, time.sleep)
    return time, clock, [clock.pass_to(round(stamp * SECOND)) for stamp in stamps]


@pytest.mark.parametrize(("rate", "seconds"), [(1.0, 2.0), (4.0, 0.5), (0.5, 4.0), (0.0, 0.0)])
def test_frames_wait_for_their_turn(rate, seconds) -> None:
    """Two recorded seconds take two at rate 1, half a second at rate 4, none at rate 0."""
    time, clock, jumps = play(rate, [100.0, 100.5, 101.0, 102.0])
    assert time.now == pytest.approx(seconds)
    assert clock.recorded == pytest.approx(2.0)
    assert not any(jumps)


def test_a_clock_that_jumps_is_not_waited_for() -> None:
    """Back by a minute and ahead by a year: told, and no time passes for it."""
    time, clock, jumps = play(1.0, [100.0, 101.0, 41.0, 42.0, 3e7, 3e7 + 1])
    assert jumps == [0.0, 0.0, pytest.approx(-60.0), 0.0, pytest.approx(3e7 - 42.0), 0.0]
    assert time.now == clock.recorded == pytest.approx(3.0)


def test_images_a_little_out_of_order_are_no_jump() -> None:
    """A tenth of a second back happens."""
    assert not any(play(1.0, [100.0, 99.9, 100.1])[2])


@pytest.mark.parametrize("rate", [-1.0, float("nan"), float("inf")])
def test_senseless_rates_are_refused(rate) -> None:
    """Negative and not finite."""
    with pytest.raises(InvalidInputError, match="rate"):
        ReplayClock(rate)


def test_the_sheet_stays_small_and_even(tmp_path) -> None:
    """Of 1000 frames at most 24 are shown; the first one is among them."""
    sheet = ContactSheet()
    colour = np.zeros((48, 64, 3), np.uint8)
    grid = VoxelGrid(np.zeros(FieldOfView().size, bool), FieldOfView())
    shown = 0
    for index in range(1000):
        shown += sheet.wants_next
        sheet.add(colour, np.ones((48, 64), bool), grid, f"{index}")
    sheet.write(tmp_path / "sheet.png")
    picture = cv2.imread(str(tmp_path / "sheet.png"))
    assert shown < 150
    assert picture.shape[0] < 9 * 210
    assert picture.shape[1] < 3 * (240 + 180 + 10)
    assert picture.std() > 10


def test_no_frame_gives_no_sheet(tmp_path) -> None:
    """An empty bag leaves no empty picture."""
    ContactSheet().write(tmp_path / "sheet.png")
    assert not (tmp_path / "sheet.png").exists()


def test_the_report_tells_what_was_skipped_and_why(tmp_path) -> None:
    """Counts by reason, jumps and speed; the same figures in summary.json."""
    summary = ReplaySummary("a bag", frames=3, recorded_seconds=2.0, seconds=0.5)
    summary.grids.append({"file": "x", "stamp": 1, "quality": 0.9, "reason": "cloth found"})
    for stamp in (2, 3):
        summary.skip(stamp, "no cloth")
    summary.clock_jumps.append({"stamp": 3, "seconds": -5.0})
    summary.write(tmp_path)
    report = (tmp_path / "report.md").read_text()
    assert "| 2 | no cloth |" in report
    assert "4.00 times real time" in report
    assert "jumped by -5.0 s" in report
    assert json.loads((tmp_path / "summary.json").read_text())["frames"] == 3
