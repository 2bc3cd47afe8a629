"""`./cell bench`: finds the benchmarks of tests/benchmark, runs one, writes its result."""

from __future__ import annotations

import importlib.util
import inspect
import json
import os
import platform
import shlex
import sys
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

from emd_core.errors import InvalidInputError
from emd_core.whole_file import write_text


@dataclass(frozen=True)
class BenchmarkResult:
    """What a benchmark's `run()` gives.

    Attributes:
        config: Settings under which it ran.
        rows: One entry for each thing measured.
        summary: The figures to quote.
    """

    config: dict[str, Any]
    rows: list[dict[str, Any]]
    summary: dict[str, Any] = field(default_factory=dict)


def find_benchmarks(root: Path) -> dict[str, Path]:
    """Every `bench_<name>.py` in tests/benchmark, by name."""
    files = sorted((root / "tests" / "benchmark").glob("bench_*.py"))
    return {file.stem.removeprefix("bench_"): file for file in files}


def run_benchmark(
    root: Path, name: str, list_all: bool, json_file: Path | None, minutes: float | None = None
) -> None:
    """List the benchmarks, or run one and print and write its result.

    Args:
        root: The checkout.
        name: Which benchmark.
        list_all: Whether to list them instead.
        json_file: Where to write the result, or None.
        minutes: How long to watch, for a benchmark that watches something; its default if None.

    Raises:
        InvalidInputError: If there is no benchmark of this name, or it watches nothing.
    """
    found = find_benchmarks(root)
    if list_all:
        for known, file in found.items():
            print(f"{known:12} {(_load(file).__doc__ or '').splitlines()[0]}")
        return
    if name not in found:
        raise InvalidInputError(f"there is no benchmark '{name}'; there are {', '.join(found)}")
    run = _load(found[name]).run
    if minutes is not None and "minutes" not in inspect.signature(run).parameters:
        raise InvalidInputError(f"benchmark '{name}' takes no --minutes; leave it out")
    result: BenchmarkResult = run() if minutes is None else run(minutes=minutes)
    document = {
        "name": name,
        "command": shlex.join(["./cell", *sys.argv[1:]]),
        "machine": machine(),
        "config": result.config,
        "rows": result.rows,
        "summary": result.summary,
    }
    text = json.dumps(document, indent=1)
    print(text)
    if json_file is not None:
        write_text(json_file, text)


def machine() -> dict[str, Any]:
    """What the figures were measured on."""
    cpu = platform.processor()
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            cpu = line.partition(":")[2].strip()
            break
    return {
        "cpu": cpu,
        "cores": len(os.sched_getaffinity(0)),
        "python": platform.python_version(),
        "system": platform.platform(),
    }


def _load(file: Path) -> ModuleType:
    specification = importlib.util.spec_from_file_location(file.stem, file)
    if specification is None or specification.loader is None:
        raise InvalidInputError(f"{file} is not a Python module")
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module
