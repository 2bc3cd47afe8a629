"""Plan, look at the prediction and how far it is to be trusted, accept, execute."""

from __future__ import annotations

import math

from nicegui import ui

from emd_console.outcomes import Proposal
from emd_console.session import Session
from emd_console.web.console import Console
from emd_console.web.controls import button, giving, guarded

_DOUBTFUL = 0.5


class WorkPanel:
    """The operator's buttons, with the figures of the plan that waits."""

    def __init__(self, console: Console, session: Session) -> None:
        """Build it."""
        self._desk = desk = console.desk
        self._session = session
        self._trust = ui.label().classes("trust").props('id="trust" aria-live="polite"')
        with ui.row().classes("commands"):
            self._look = button("Look", giving(session, "look", "looking", desk.look), "l")
            self._plan = button(
                "Plan", giving(session, "plan", "planning", desk.plan), "p", kind="outline"
            )
            self._step = button(
                "Execute",
                giving(session, "execute", "folding", desk.execute_step),
                "e",
                kind="unelevated",
            ).classes("accept")
            self._all = button(
                "Execute all", giving(session, "execute all", "folding", desk.execute_all), "a"
            )
            self._pause = button("Pause", guarded(self._on_pause), " ")
            self._discard = button("Discard", guarded(self._on_discard), "x")
            self._home = button("Arms home", giving(session, "home", "going home", desk.go_home))
            self._reset = button(
                "New cloth", giving(session, "new cloth", "laying a new cloth", desk.reset), "n"
            )
        ui.html('<div id="message" aria-live="polite"></div>', sanitize=False)

    def refresh(self) -> None:
        """Bar what may not be done now, and say what the plan is worth."""
        desk = self._desk
        free = self._session.commands and not desk.doing
        steps = len(desk.proposal.plan.manipulations) if desk.proposal else 0
        self._look.set_enabled(free)
        self._plan.set_enabled(free and desk.goal is not None)
        self._step.set_enabled(free and steps > 0)
        self._step.text = "Execute" if steps < 2 else f"Execute step 1 of {steps}"
        self._all.set_visibility(steps > 1)
        self._all.set_enabled(free)
        self._pause.set_visibility(bool(desk.doing))
        self._pause.set_enabled(self._session.commands and not desk.pausing)
        self._discard.set_enabled(free and steps > 0)
        self._home.set_enabled(free)
        self._reset.set_visibility(desk.port.can_reset())
        self._reset.set_enabled(free)
        self._trust.text = trust_text(desk.shown)
        doubtful = desk.shown is not None and is_doubtful(desk.shown)
        self._trust.classes(add="doubtful") if doubtful else self._trust.classes(remove="doubtful")

    def _on_pause(self) -> None:
        def pause() -> None:
            self._desk.pausing = True

        self._session.change("pause", pause)

    def _on_discard(self) -> None:
        self._session.change("discard plan", self._desk.discard)


def is_doubtful(proposal: Proposal) -> bool:
    """Whether a plan is more likely to fail than not, or promises no gain."""
    plan = proposal.plan
    likely = plan.failure_probability > _DOUBTFUL
    return likely or plan.expected_error >= proposal.mse_now


def trust_text(proposal: Proposal | None) -> str:
    """Say in a sentence what is to be expected of a plan."""
    if proposal is None:
        return "No plan yet: choose a goal and plan."
    plan = proposal.plan
    chance = plan.failure_probability
    if math.isnan(chance):
        trust = "how often such plans fail is not known"
    else:
        trust = f"{min(max(1 - chance, 0.01), 0.99):.0%} likely to work"  # never sure
    text = (
        f"Voxel MSE {proposal.mse_now:.4f} now, {plan.expected_error:.4f} expected; {trust}. "
        f"Planned in {plan.planning_seconds:.1f} s."
    )
    return f"Doubtful. {text}" if is_doubtful(proposal) else text
