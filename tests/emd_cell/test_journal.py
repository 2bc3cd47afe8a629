"""Journals of runs that can be interrupted."""

from __future__ import annotations

from pathlib import Path

import pytest

from emd_cell.journal import Journal
from emd_core.errors import InvalidInputError

RUN = {"seed": 3, "identity": "abc"}


def test_records_are_there_again(tmp_path: Path) -> None:
    """What was appended is read by the next journal of the same run, in a folder that it made."""
    path = tmp_path / "new" / "journal.jsonl"
    first = Journal(path, RUN)
    assert first.records == []
    first.append({"index": 0, "value": 0.1})
    first.append({"index": 1, "value": None})
    assert (
        Journal(path, RUN).records
        == first.records
        == [
            {"index": 0, "value": 0.1},
            {"index": 1, "value": None},
        ]
    )


@pytest.mark.parametrize("cut", [1, 12])
def test_a_cut_off_line_is_dropped(tmp_path: Path, cut: int) -> None:
    """A journal whose last line a kill has cut goes on after the last whole one."""
    path = tmp_path / "journal.jsonl"
    journal = Journal(path, RUN)
    journal.append({"index": 0})
    journal.append({"index": 1})
    path.write_text(path.read_text()[:-cut])
    again = Journal(path, RUN)
    assert again.records == [{"index": 0}]
    again.append({"index": 1})
    assert Journal(path, RUN).records == [{"index": 0}, {"index": 1}]


def test_another_run_is_refused(tmp_path: Path) -> None:
    """Another seed's journal is left as it is, and the error names both."""
    path = tmp_path / "journal.jsonl"
    Journal(path, RUN).append({"index": 0})
    before = path.read_bytes()
    with pytest.raises(InvalidInputError, match=r"'seed': 4.*'seed': 3.*delete"):
        Journal(path, {**RUN, "seed": 4})
    assert path.read_bytes() == before
