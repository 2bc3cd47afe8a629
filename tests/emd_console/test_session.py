"""What a visitor may command."""

import asyncio
import json

import pytest

from emd_console.access import Role
from emd_console.session import Session
from emd_core.errors import BusyError


@pytest.fixture
def make(desk, lease, log):
    """Makes sessions at one desk."""
    return lambda role, name: Session(desk, lease, log, role, name, identity=name)


def test_a_viewer_can_do_nothing(make, desk, cell, log) -> None:
    """Not take command, not look, not choose, not stop; all of it is logged."""
    viewer = make(Role.VIEWER, "vera")
    tries = [
        viewer.take_command,
        viewer.stop,
        lambda: asyncio.run(viewer.give("look", "looking", desk.look)),
        lambda: viewer.change("choose goal", lambda: desk.choose_goal("half")),
    ]
    for attempt in tries:
        with pytest.raises(BusyError, match="viewers only look"):
            attempt()
    assert cell.calls == [] and desk.goal is None
    assert [entry["outcome"] for entry in log.latest] == ["refused: viewers only look"] * 4


def test_only_one_operator_commands_but_every_operator_may_stop(make, desk, cell) -> None:
    """Stopping is everybody's who may operate."""
    ada, bob = make(Role.OPERATOR, "ada"), make(Role.OPERATOR, "bob")
    assert ada.take_command() and not bob.take_command()
    with pytest.raises(BusyError, match="ada commands"):
        asyncio.run(bob.give("look", "looking", desk.look))
    assert cell.calls == []
    bob.stop()
    assert cell.calls == ["stop"]
    assert asyncio.run(ada.give("look", "looking", desk.look))


def test_every_command_is_logged_with_who_and_when(make, desk, log, tmp_path) -> None:
    """One JSON object a line, the outcome included."""
    ada = make(Role.OPERATOR, "ada")
    ada.take_command()
    ada.change("choose goal", lambda: desk.choose_goal("half"), goal="half")
    asyncio.run(ada.give("plan", "planning", desk.plan))
    lines = (tmp_path / "commands.jsonl").read_text().splitlines()
    entries = [json.loads(line) for line in lines]
    assert [entry["command"] for entry in entries] == [
        "take command", "choose goal", "plan", "plan",
    ]  # fmt: skip
    assert all(entry["who"] == "ada (operator)" and "T" in entry["time"] for entry in entries)
    assert entries[2]["outcome"] == "begun" and entries[3]["outcome"].startswith("done")


def test_a_busy_cell_takes_no_second_command(make, desk, cell) -> None:
    """The refusal says what it does."""
    ada = make(Role.OPERATOR, "ada")
    ada.take_command()
    desk.doing = "folding"
    with pytest.raises(BusyError, match="folding"):
        asyncio.run(ada.give("look", "looking", desk.look))
    assert cell.calls == []
