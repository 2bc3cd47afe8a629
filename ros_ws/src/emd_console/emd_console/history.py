"""What the cell did under each console: its manipulations, and what was asked of it meanwhile."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from emd_console.example_store import StoredExample, stored_examples

EXAMPLES = "examples"
COMMANDS = "commands.jsonl"
_TROUBLES = ("failed", "refused")


@dataclass(frozen=True)
class Run:
    """What was done from one start of a console to the next.

    Attributes:
        number: Counts the runs that left recordings, from 0.
        start: When the console was started, or made its first recording; ISO 8601, UTC.
        examples: Manipulations carried out, the oldest first.
        commands: What was asked for, as the log of commands has it, the oldest first.
    """

    number: int
    start: str
    examples: tuple[StoredExample, ...]
    commands: tuple[Mapping[str, Any], ...]

    @property
    def scores(self) -> list[tuple[float, float]]:
        """Voxel MSE to the goal before and after each manipulation that had one."""
        entries = (example.entry for example in self.examples)
        return [
            (entry["mse_before"], entry["mse_after"])
            for entry in entries
            if None not in (entry.get("mse_before"), entry.get("mse_after"))
        ]

    @property
    def seconds(self) -> float | None:
        """Median of what a manipulation took; None if no recording tells."""
        known = [value for e in self.examples if (value := e.entry.get("seconds")) is not None]
        return float(np.median(known)) if known else None

    @property
    def stops(self) -> int:
        """How often stop was pressed."""
        return sum(entry.get("command") == "stop" for entry in self.commands)

    @property
    def troubles(self) -> list[Mapping[str, Any]]:
        """Commands that failed or were refused."""
        return [
            entry for entry in self.commands if str(entry.get("outcome", "")).startswith(_TROUBLES)
        ]

    def count(self, kind: str) -> int:
        """How many manipulations were `planned` or `taught`."""
        return sum(example.entry.get("kind") == kind for example in self.examples)


def read_history(directory: Path) -> list[Run]:
    """Read all runs of a console's directory, the oldest first, also while a console runs.

    Recordings of versions that did not tell the run count as runs by their day.
    """
    by_start: dict[str, list[StoredExample]] = {}
    for example in stored_examples(directory / EXAMPLES):
        entry = example.entry
        by_start.setdefault(entry.get("run") or entry["time"][:10], []).append(example)
    starts = sorted(by_start)
    commands = _commands(directory / COMMANDS)
    ends = [*starts[1:], "9999"][: len(starts)]
    return [
        Run(number, start, tuple(by_start[start]), _between(commands, start, end))
        for number, (start, end) in enumerate(zip(starts, ends, strict=True))
    ]


def _between(
    commands: Sequence[Mapping[str, Any]], start: str, end: str
) -> tuple[Mapping[str, Any], ...]:
    """Commands of a span of time; times are ISO 8601 in UTC, which sort as they follow."""
    return tuple(entry for entry in commands if start <= str(entry.get("time", "")) < end)


def _commands(path: Path) -> list[dict[str, Any]]:
    """Lines of the log; one that a killed console left unfinished is passed over."""
    if not path.is_file():
        return []
    entries = []
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        try:
            entries.append(json.loads(line))
        except ValueError:
            continue
    return [entry for entry in entries if isinstance(entry, dict)]
