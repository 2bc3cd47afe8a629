"""Resolves requirements.in into requirements.lock."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

from emd_core.errors import InvalidInputError
from emd_core.whole_file import write_text

_HEADING = (
    "# Every version of the environment, for CPython 3.11 and 3.12.\n"
    "# Written by `./cell lock` from requirements.in.\n"
)


def write_lock(requirements: Path, lock: Path) -> int:
    """Write the version of every package that pip would install; returns how many.

    Raises:
        InvalidInputError: If pip finds no solution.
    """
    with tempfile.TemporaryDirectory() as directory:
        answer = Path(directory) / "report.json"
        command = [sys.executable, "-m", "pip", "install", "--quiet", "--dry-run"]
        command += ["--ignore-installed", "--report", str(answer), "-r", str(requirements)]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode != 0:
            raise InvalidInputError(f"pip cannot resolve {requirements}:\n{done.stderr}")
        packages = json.loads(answer.read_text())["install"]
    pins = sorted({_pin(package["metadata"]) for package in packages})
    write_text(lock, _HEADING + "".join(f"{pin}\n" for pin in pins))
    return len(pins)


def _pin(metadata: dict[str, str]) -> str:
    """Name and version without a local part such as `+cpu`, which no index offers elsewhere."""
    name = metadata["name"].lower().replace("_", "-")
    return f"{name}=={metadata['version'].partition('+')[0]}"
