"""A console's desk at a cell that obeys."""

import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from emd_console.command_log import CommandLog
from emd_console.desk import Desk
from emd_console.example_store import ExampleStore
from emd_console.operator_lease import OperatorLease


def _load_fake_cell() -> None:
    """Tests import it as `fake_cell`."""
    file = Path(__file__).with_name("fake_cell.py")
    specification = importlib.util.spec_from_file_location("fake_cell", file)
    assert specification is not None and specification.loader is not None
    sys.modules["fake_cell"] = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(sys.modules["fake_cell"])


_load_fake_cell()


@pytest.fixture
def cell():
    """A cell that obeys."""
    from fake_cell import FakeCell

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
