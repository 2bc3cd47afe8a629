"""What all commands of `./cell` share."""

from __future__ import annotations

import sys
from pathlib import Path

import typer
from rich.console import Console

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="The EMD folding cell: cloth manipulation on ROS 2.",
)
console = Console(stderr=True)
ROOT = Path(sys.prefix).parent  # the checkout: `.venv` lies in it
