"""Runs of the cell, and the report on them."""

import base64
import json
import time
from dataclasses import replace
from html.parser import HTMLParser

import pytest
from fake_cell import example
from typer.testing import CliRunner

from emd_cell.cli import app
from emd_console.command_log import CommandLog
from emd_console.example_store import ACCEPTED, ExampleStore, Review
from emd_console.history import COMMANDS, EXAMPLES, read_history
from emd_console.report import report_html, write_report
from emd_core.errors import InvalidInputError

SCORES = {"goal": "half", "mse_before": 0.04, "mse_after": 0.01, "seconds": 21.0}


@pytest.fixture
def directory(tmp_path):
    """A console's directory: two runs, of two manipulations and of one."""
    log = CommandLog(tmp_path / COMMANDS)
    before = {"time": "2019-05-17T10:00:00.000+00:00", "command": "look", "outcome": "done"}
    (tmp_path / COMMANDS).write_text(json.dumps(before) + "\n")  # of a run that left nothing
    for kinds in (("planned", "taught"), ("taught",)):
        store = ExampleStore(tmp_path / EXAMPLES)
        for kind in kinds:
            store.add(replace(example(kind), details=SCORES if kind == "planned" else {}))
            log.write("ada (operator)", "execute", "failed: a <b>joint</b> stalled")
        store.close()
        time.sleep(0.01)  # times are kept in milliseconds
    log.write("ada (operator)", "stop", "done")
    return tmp_path


class Sources(HTMLParser):
    """Addresses in a page, and its tags."""

    def __init__(self, page: str) -> None:
        """Read a page."""
        super().__init__()
        self.addresses: list[str] = []
        self.tags: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag, attributes) -> None:
        """Take a tag."""
        self.tags.append(tag)
        self.addresses += [value for name, value in attributes if name in ("src", "href")]


def test_manipulations_and_commands_belong_to_the_run_in_which_they_were(directory) -> None:
    """A run lasts from one start of the console to the next."""
    first, second = read_history(directory)
    assert [first.number, second.number] == [0, 1] and first.start < second.start
    assert [item.number for item in first.examples] == [0, 1]
    assert (first.count("planned"), first.count("taught"), second.count("taught")) == (1, 1, 1)
    assert first.scores == [(0.04, 0.01)] and first.seconds == 21.0
    assert second.scores == [] and second.seconds is None
    assert [entry["command"] for entry in first.commands] == ["execute", "execute"]
    assert (first.stops, second.stops, len(second.troubles)) == (0, 1, 1)


def test_a_line_that_was_not_finished_and_older_recordings_are_no_obstacle(directory) -> None:
    """A killed console leaves half a line; recordings without a run count by their day."""
    with (directory / COMMANDS).open("a") as stream:
        stream.write('{"time": "2031')
    file = directory / EXAMPLES / "example_00000" / "example.json"
    entry = json.loads(file.read_text())
    del entry["run"]
    file.write_text(json.dumps({**entry, "time": "2020-05-17T10:00:00+00:00"}))
    runs = read_history(directory)
    assert [run.start[:10] for run in runs][0] == "2020-05-17" and len(runs) == 3
    assert read_history(directory / "absent") == []


def test_a_report_holds_its_pictures_and_asks_nobody(directory) -> None:
    """Every picture is inside, byte for byte; no address leads elsewhere; no script; no names."""
    page = report_html(read_history(directory))
    found = Sources(page)
    assert len(found.addresses) == 6
    wanted = [
        (directory / EXAMPLES / f"example_{number:05d}" / f"{moment}.jpg").read_bytes()
        for number in (2, 0, 1)
        for moment in ("before", "after")
    ]
    assert [base64.b64decode(item.partition(",")[2]) for item in found.addresses] == wanted
    assert all(item.startswith("data:image/jpeg;base64,") for item in found.addresses)
    assert "script" not in found.tags and "http" not in page and "ada" not in page
    assert "0.0400" in page and "0.0100" in page and "Half, towards the robot" in page


def test_what_people_wrote_is_text_in_the_report(directory) -> None:
    """A note cannot become part of the page."""
    store = ExampleStore(directory / EXAMPLES)
    store.review(0, Review(ACCEPTED, "<script>alert(1)</script>", "ada"))
    store.close()
    page = report_html(read_history(directory))
    assert "&lt;script&gt;alert(1)" in page and "<script" not in page and "<b>joint" not in page


def test_a_report_of_one_run_or_of_all_is_written(directory, tmp_path) -> None:
    """By function and command; a run that is not there, and a folder without any, are refused."""
    out = tmp_path / "report.html"
    assert write_report(directory, out) == 2
    whole = out.read_text()
    result = CliRunner().invoke(
        app, ["console-report", "--out", str(out), "--directory", str(directory), "--run", "1"]
    )
    assert result.exit_code == 0 and "1 run" in result.output
    assert "Run 0" not in out.read_text() and "Run 0" in whole and "Run 1" in out.read_text()
    with pytest.raises(InvalidInputError, match="0..1"):
        write_report(directory, out, 2)
    with pytest.raises(InvalidInputError, match="no recorded manipulation"):
        write_report(tmp_path / "empty", out)
