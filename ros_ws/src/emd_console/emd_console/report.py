"""A report on the cell's runs as one HTML file with its pictures inside, to send around."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from jinja2 import Environment, StrictUndefined

from emd_console.example_store import StoredExample
from emd_console.goals import TITLES
from emd_console.history import Run, read_history
from emd_core.errors import InvalidInputError
from emd_core.whole_file import write_text

_TEMPLATE = Path(__file__).with_name("report.html.j2")


def report_html(runs: Sequence[Run]) -> str:
    """Tell of runs, the newest first; whoever gave the commands is not named."""
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    environment.filters.update(
        record=_record, picture=_picture, mse=_mse, clock=_clock, title=_title
    )
    template = environment.from_string(_TEMPLATE.read_text(encoding="utf-8"))
    made = datetime.now(UTC).isoformat(timespec="minutes")
    return template.render(runs=list(reversed(runs)), made=made)


def write_report(directory: Path, out: Path, number: int | None = None) -> int:
    """Write a report on a console's directory; gives how many runs it tells of.

    Args:
        directory: The console's.
        out: The file to write.
        number: Only of this run; of all if None.

    Raises:
        InvalidInputError: If there is nothing to tell of, or nothing can be written there.
    """
    runs = read_history(directory)
    if not runs:
        raise InvalidInputError(
            f"{directory} holds no recorded manipulation; execute a plan, or teach one, on the "
            "console"
        )
    if number is not None and not 0 <= number < len(runs):
        raise InvalidInputError(f"there are runs 0..{len(runs) - 1}, got {number}")
    chosen = runs if number is None else [runs[number]]
    write_text(out, report_html(chosen))
    return len(chosen)


def _record(example: StoredExample) -> dict[str, Any]:
    """What was recorded; None for what an older version did not record."""
    named = ("kind", "time", "goal", "mse_before", "mse_after", "seconds", "plan")
    return {name: example.entry.get(name) for name in named}


def _picture(example: StoredExample, moment: str) -> str:
    """A recording's picture as the address of itself; empty without one."""
    file = example.folder / f"{moment}.jpg"
    if not file.is_file():
        return ""
    return f"data:image/jpeg;base64,{base64.b64encode(file.read_bytes()).decode()}"


def _mse(value: float | None) -> str:
    return "–" if value is None else f"{value:.4f}"


def _clock(time: str) -> str:
    """Date and time for people."""
    return time.replace("T", " ")[:16]


def _title(goal: str | None) -> str:
    return TITLES.get(goal or "", goal or "")
