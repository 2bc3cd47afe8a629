"""Every command, with who gave it and when, one JSON object a line."""

from __future__ import annotations

import json
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from emd_core.errors import InvalidInputError


class CommandLog:
    """Appends to a file and keeps the last lines for the page."""

    def __init__(self, path: Path, kept: int = 50) -> None:
        """Open the log.

        Args:
            path: The file; its folder is made if need be.
            kept: Entries to remember.

        Raises:
            InvalidInputError: If nothing can be written there.
        """
        self._path = path
        self._kept = kept
        self.latest: list[dict[str, Any]] = []
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.touch()
        except OSError as err:
            raise InvalidInputError(f"cannot write the command log {path}: {err}") from err

    def write(self, who: str, command: str, outcome: str, **details: Any) -> Mapping[str, Any]:
        """Add a line.

        Args:
            who: Name and role of who gave the command.
            command: What was asked for.
            outcome: done, or why not.
            details: Anything else that JSON holds.
        """
        entry = {
            "time": datetime.now(UTC).isoformat(timespec="milliseconds"),
            "who": who,
            "command": command,
            "outcome": outcome,
            **details,
        }
        with self._path.open("a", encoding="utf-8") as stream:
            stream.write(json.dumps(entry) + "\n")
        self.latest = [*self.latest[1 - self._kept :], entry]
        return entry
