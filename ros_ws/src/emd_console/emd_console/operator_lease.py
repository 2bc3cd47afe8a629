"""One operator at a time: who commands, who asks to, and when it changes hands."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from emd_core.errors import BusyError

ASK_TIMEOUT = 20.0  # seconds in which a holder may keep the cell from who asks for it
ABSENCE = 10.0  # seconds after which a holder who is gone has lost it


@dataclass
class _Ask:
    who: str
    name: str
    since: float


class OperatorLease:
    """Command over the cell, held by one session.

    It is taken when free, given to who asks by the holder's consent or after `ASK_TIMEOUT`
    without an answer, and free again when its holder has not been seen for `ABSENCE`.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Nobody holds it yet; `clock` gives seconds."""
        self._clock = clock
        self._holder: str | None = None
        self._name = ""
        self._seen = 0.0
        self._ask: _Ask | None = None

    @property
    def holder(self) -> str | None:
        """The session that commands; None if nobody."""
        self._settle()
        return self._holder

    @property
    def holder_name(self) -> str:
        """How the holder is called, or empty."""
        return self._name if self.holder else ""

    @property
    def asked_by(self) -> tuple[str, float] | None:
        """Who asks for the command, and the seconds left to refuse."""
        self._settle()
        if self._ask is None:
            return None
        return self._ask.name, max(0.0, self._ask.since + ASK_TIMEOUT - self._clock())

    def asks(self, session: str) -> bool:
        """Whether this session has asked and waits."""
        self._settle()
        return self._ask is not None and self._ask.who == session

    def take(self, session: str, name: str) -> bool:
        """Take the command if it is free, else ask for it; True if it is held now."""
        self._settle()
        if self._holder in (None, session):
            self._give(session, name)
            return True
        if self._ask is None:
            self._ask = _Ask(session, name, self._clock())
        return False

    def seen(self, session: str) -> None:
        """A session is there."""
        if session == self._holder:
            self._seen = self._clock()

    def consent(self, session: str) -> None:
        """The holder gives the command to who asks."""
        if session == self.holder and self._ask is not None:
            self._give(self._ask.who, self._ask.name)

    def refuse(self, session: str) -> None:
        """The holder keeps it."""
        if session == self.holder:
            self._ask = None

    def release(self, session: str) -> None:
        """A session leaves: the command goes to who asks, or to nobody."""
        if self._ask is not None and self._ask.who == session:
            self._ask = None
        if session != self._holder:
            return
        if self._ask is not None:
            self._give(self._ask.who, self._ask.name)
        else:
            self._holder, self._name = None, ""

    def require(self, session: str) -> None:
        """Complain unless this session commands.

        Raises:
            BusyError: If another one does, or nobody.
        """
        if self.holder != session:
            who = f"{self._name} commands" if self._holder else "nobody commands"
            raise BusyError(f"only who commands the cell may do this, {who}; take command first")

    def _settle(self) -> None:
        now = self._clock()
        if self._holder is not None and now - self._seen > ABSENCE:
            self.release(self._holder)
        if self._ask is not None and now - self._ask.since > ASK_TIMEOUT:
            self._give(self._ask.who, self._ask.name)

    def _give(self, session: str, name: str) -> None:
        self._holder, self._name, self._seen = session, name, self._clock()
        self._ask = None
