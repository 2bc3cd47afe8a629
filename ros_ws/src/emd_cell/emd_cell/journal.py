"""A run's results so far, one JSON line each, so that an interrupted run can go on."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from emd_core.errors import InvalidInputError


class Journal:
    """Records of one run in a file whose first line says of which."""

    def __init__(self, path: Path, run: dict[str, Any]) -> None:
        """Begin a journal, or read how far one has come; a last line that was cut off is dropped.

        Args:
            path: The file.
            run: What must be the same to go on, as JSON holds it.

        Raises:
            InvalidInputError: If the file is another run's journal.
        """
        self.path = path
        text = path.read_text() if path.exists() else ""
        whole = text[: text.rfind("\n") + 1]
        first, *records = [json.loads(line) for line in whole.splitlines()] or [None]
        if first is None:
            path.parent.mkdir(parents=True, exist_ok=True)
            whole = json.dumps(run) + "\n"
        elif first != run:
            raise InvalidInputError(
                f"{path} should be the journal of {run}, it is of {first}; name another place or "
                "delete it"
            )
        if whole != text:
            path.write_text(whole)
        self.records: list[dict[str, Any]] = records

    def append(self, record: dict[str, Any]) -> None:
        """Keep a record."""
        with self.path.open("a") as lines:
            lines.write(json.dumps(record) + "\n")
        self.records.append(record)
