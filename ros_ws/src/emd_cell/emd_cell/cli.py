"""`./cell`: its commands, and how they end."""

from __future__ import annotations

import signal
import subprocess
import sys
from typing import Annotated

import typer

from emd_cell.commands.app import ROOT, app
from emd_core.errors import CellError, ErrorCode

# isort: off
# These add their commands to `app`, which lists them in this order.
from emd_cell.commands import running  # noqa: F401
from emd_cell.commands import camera  # noqa: F401
from emd_cell.commands import learning  # noqa: F401
from emd_cell.commands import judging  # noqa: F401
# isort: on

_NO_TESTS = 5  # pytest's status where none is chosen


@app.command()
def setup() -> None:
    """Set up or repair the environment, nothing else."""
    print("The environment is ready.")  # the bootstrap has done it before this is reached


@app.command(name="exec")
def exec_command() -> None:
    """Run a command inside the environment: ./cell exec -- COMMAND [ARGS]."""


@app.command()
def test(
    slow: Annotated[bool, typer.Option("--slow", help="also the slow ones")] = False,
    pytest_arguments: Annotated[
        list[str] | None, typer.Argument(help="passed to pytest, after --")
    ] = None,
) -> None:
    """Run ruff, mypy and all tests: those without nodes on all cores, then those with."""
    sources = ["ros_ws/src", "tests", "cell"]
    packages = sorted(str(path.parent) for path in ROOT.glob("ros_ws/src/*/*/py.typed"))
    fast, arguments = ("" if slow else " and not slow"), pytest_arguments or []
    parallel = ["-n", "auto", "--dist", "loadfile"]  # a file's tests share what they prepare
    commands = [
        ["ruff", "check", *sources],
        ["ruff", "format", "--check", *sources],
        ["mypy", *packages],
        ["pytest", *parallel, "-m", f"not system{fast}", *arguments],
        ["pytest", "-m", f"system{fast}", *arguments],
    ]
    ended = [
        (command[0], subprocess.run([sys.executable, "-m", *command], cwd=ROOT).returncode)
        for command in commands
    ]
    if ("pytest", 0) in ended:  # the arguments may choose tests of one kind only
        ended = [end for end in ended if end != ("pytest", _NO_TESTS)]
    failed = [name for name, status in ended if status != 0]
    if failed:
        print(f"cell test: failed: {', '.join(failed)}", file=sys.stderr)
        raise typer.Exit(1)


@app.command()
def lock() -> None:
    """Write requirements.lock anew from requirements.in."""
    from emd_cell.lock import write_lock

    count = write_lock(ROOT / "requirements.in", ROOT / "requirements.lock")
    print(f"{count} packages in requirements.lock")


def main() -> int:
    """Run a command; a user's mistake is one line and status 2, a failure status 1."""
    for stop in (signal.SIGINT, signal.SIGTERM):  # also where a shell or container ignores SIGINT
        signal.signal(stop, signal.default_int_handler)
    try:
        app(prog_name="./cell")
    except CellError as err:
        command = sys.argv[1] if len(sys.argv) > 1 else ""
        print(f"cell {command}: {err}", file=sys.stderr)
        return 2 if err.code is ErrorCode.INVALID_INPUT else 1
    except KeyboardInterrupt:
        print("cell: interrupted", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
