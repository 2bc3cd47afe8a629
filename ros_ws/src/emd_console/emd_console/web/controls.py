"""Buttons that command the cell: each asks the session, says what went wrong, and has a key."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

from nicegui import ui

from emd_console.session import Session
from emd_core.errors import CellError


def button(
    label: str, handler: Callable[..., Any], key: str = "", icon: str = "", kind: str = "flat"
) -> ui.button:
    """Make a button.

    Args:
        label: What it says.
        handler: What it does.
        key: Which key does the same; it is shown in the title.
        icon: A Material icon's name, or empty.
        kind: Quasar's props for its look.
    """
    made = ui.button(label, on_click=handler, icon=icon or None, color=None)
    made.props(f"{kind} no-caps dense").classes("command")
    if key:
        made.props(f'data-key="{key}" aria-keyshortcuts="{key}" title="key {key.upper()}"')
    return made


def tell(text: str, bad: bool = True) -> None:
    """Say something in passing."""
    ui.notify(text, type="negative" if bad else "info", position="bottom", multi_line=True)


def guarded(task: Callable[..., Any]) -> Callable[..., Any]:
    """Turn a CellError of a handler into a message to who caused it."""

    def run(*arguments: Any) -> None:
        try:
            task(*arguments)
        except CellError as err:
            tell(str(err))

    return run


async def give(
    session: Session, command: str, doing: str, task: Callable[[], Awaitable[str]], **details: Any
) -> bool:
    """Give a command; what went wrong is told to who gave it."""
    try:
        good = await session.give(command, doing, task, **details)
    except CellError as err:
        tell(str(err))
        return False
    if not good:
        tell(session.desk.message)
    return good


def giving(
    session: Session, command: str, doing: str, task: Callable[[], Awaitable[str]]
) -> Callable[[], Awaitable[bool]]:
    """Make a button's handler that gives a command."""
    return partial(give, session, command, doing, task)
