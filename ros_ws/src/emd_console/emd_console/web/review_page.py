"""The page of recordings: look at each, keep it or not, and say why."""

from __future__ import annotations

from functools import partial
from typing import Any

from nicegui import ui
from starlette.requests import Request

from emd_console.example_store import ACCEPTED, REJECTED, UNDECIDED, Review, StoredExample
from emd_console.session import Session
from emd_console.web.console import Console
from emd_console.web.controls import button, guarded
from emd_console.web.frame import plain_page
from emd_console.web.main_page import open_session

_SHOWN = 60


def add_review_page(console: Console) -> None:
    """Serve the page at `/review`."""

    @ui.page("/review", response_timeout=30.0)
    def review_page(request: Request) -> None:
        session = open_session(console, request)
        plain_page(console, session, "recordings")
        ReviewPanel(console, session).show()


class ReviewPanel:
    """All recordings, the newest first."""

    def __init__(self, console: Console, session: Session) -> None:
        """Build an empty list."""
        self._store = console.store
        self._session = session
        self._undo: list[tuple[int, Review]] = []
        with ui.element("main").classes("review"):
            with ui.row().classes("review-head"):
                self._title = ui.label().classes("title")
                ui.space()
                self._undo_button = button("Undo", guarded(self._on_undo), "u")
            self._list = ui.element("div").classes("examples")

    def show(self) -> None:
        """Draw the list anew."""
        examples = self._store.all()
        accepted = sum(item.review.verdict == ACCEPTED for item in examples)
        self._title.text = f"{len(examples)} recorded, {accepted} accepted"
        self._undo_button.set_enabled(bool(self._undo))
        self._list.clear()
        with self._list:
            for example in examples[:_SHOWN]:
                self._card(example)
            if not examples:
                ui.label("Nothing recorded yet: execute a plan, or teach one.").classes("hint")

    def _card(self, example: StoredExample) -> None:
        entry, review = example.entry, example.review
        with ui.element("article").classes(f"card example {review.verdict}"):
            with ui.element("div").classes("pair"):
                for moment in ("before", "after"):
                    ui.html(
                        f'<img src="/examples/{example.number}/{moment}.jpg" '
                        f'alt="{moment} the manipulation" loading="lazy">',
                        sanitize=False,
                    )
            ui.label(title_text(example)).classes("title")
            ui.label(_figures(example)).classes("hint")
            with ui.row().classes("motion"):
                ui.label(motion_text(entry.get("motion"))).classes("hint")
                if entry.get("motion"):
                    ui.link("Replay", f"/replay/{example.number}").classes("nav")
            note = ui.input("note", value=review.note).props("dense maxlength=500")
            note.on("blur", guarded(lambda *_: self._judge(example, review.verdict, note.value)))
            with ui.row().classes("verdicts"):
                for verdict, label in ((ACCEPTED, "Accept"), (REJECTED, "Reject")):
                    chosen = verdict == review.verdict
                    judge = partial(self._judge, example, UNDECIDED if chosen else verdict)
                    made = button(
                        f"{label}ed" if chosen else label,
                        guarded(lambda *_, judge=judge: judge(note.value)),
                        kind="unelevated" if chosen else "outline",
                    )
                    made.set_enabled(self._session.may_operate)

    def _judge(self, example: StoredExample, verdict: str, note: str) -> None:
        review = Review(verdict, note or "", self._session.who)
        before = self._store.get(example.number).review
        if (before.verdict, before.note) == (review.verdict, review.note):
            return
        self._session.require_operator("review")
        self._store.review(example.number, review)
        self._session.log.write(
            self._session.who, "review", verdict, example=example.number, note=review.note
        )
        self._undo.append((example.number, before))
        self.show()

    def _on_undo(self) -> None:
        if self._undo:
            self._session.require_operator("undo review")
            number, review = self._undo.pop()
            self._store.review(number, review)
            self._session.log.write(self._session.who, "undo review", "done", example=number)
            self.show()


def title_text(example: StoredExample) -> str:
    """Number, kind and time of a recording."""
    time = example.entry["time"].replace("T", " ")[:19]
    return f"{example.number} · {example.entry['kind']} · {time} UTC"


def motion_text(figures: dict[str, Any] | None) -> str:
    """Say how long a recorded motion is, and how large its bag."""
    if not figures:
        return "no bag of the motion"
    return f"motion {figures['seconds']:.0f} s, bag {figures['bytes'] / 1e6:.1f} MB"


def _figures(example: StoredExample) -> str:
    entry = example.entry
    before, after = entry.get("mse_before"), entry.get("mse_after")
    score = "" if before is None else f"{entry['goal']}: voxel MSE {before:.4f} to {after:.4f}, "
    return f"{score}by {entry['who']}"
