"""Small pieces of the page."""

from __future__ import annotations

from nicegui import ui


def figure(name: str, title: str) -> None:
    """A place where a voxel grid is drawn; its canvas is `grid-<name>`."""
    ui.html(
        f'<figure class="grid"><canvas id="grid-{name}" tabindex="-1"></canvas>'
        f'<figcaption>{title}<span id="note-{name}"></span></figcaption></figure>',
        sanitize=False,
    )
