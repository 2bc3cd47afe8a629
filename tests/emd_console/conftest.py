"""A console's desk at a cell that obeys."""

from collections.abc import Iterator

import pytest
from fake_cell import FakeCell

from emd_console.command_log import CommandLog
from emd_console.desk import Desk
from emd_console.example_store import ExampleStore
from emd_console.operator_lease import OperatorLease


@pytest.fixture
def cell() -> FakeCell:
    """A cell that obeys."""
    return FakeCell()


@pytest.fixture
def store(tmp_path) -> Iterator[ExampleStore]:
    """An empty store."""
    made = ExampleStore(tmp_path / "examples")
    yield made
    made.close()


@pytest.fixture
def desk(cell, store) -> Desk:
    """A desk at that cell."""
    return Desk(cell, store)


@pytest.fixture
def lease() -> OperatorLease:
    """Nobody commands yet."""
    return OperatorLease()


@pytest.fixture
def log(tmp_path) -> CommandLog:
    """An empty log."""
    return CommandLog(tmp_path / "commands.jsonl")
