"""What other processes take of this machine, read from /proc."""

from __future__ import annotations

import os
from pathlib import Path

_TICKS = os.sysconf("SC_CLK_TCK")
_PAGE = os.sysconf("SC_PAGE_SIZE")


def memory_mb(process: int) -> float:
    """Resident memory of a process, megabytes.

    Raises:
        FileNotFoundError: If there is no such process.
    """
    return int(Path(f"/proc/{process}/statm").read_text().split()[1]) * _PAGE / 1e6


def cpu_seconds(process: int) -> float:
    """Processor time that a process and its threads have taken so far, seconds.

    Raises:
        FileNotFoundError: If there is no such process.
    """
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS  # utime, stime: 14 and 15 of the line


def descendants(process: int) -> list[int]:
    """All processes that a process has started and that are still there, theirs too."""
    found: list[int] = []
    try:
        for task in Path(f"/proc/{process}/task").iterdir():
            for child in (task / "children").read_text().split():
                found += [int(child), *descendants(int(child))]
    except (FileNotFoundError, ProcessLookupError):  # it ended while we looked
        pass
    return found
