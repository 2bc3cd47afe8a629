"""The console as a whole: what its pages share."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from emd_console.access import AccessPolicy
from emd_console.cell_state import CellState
from emd_console.command_log import CommandLog
from emd_console.desk import Desk
from emd_console.example_store import ExampleStore
from emd_console.operator_lease import OperatorLease
from emd_console.web.live import LiveFeed

STATIC = Path(__file__).parent / "static"


@dataclass(frozen=True)
class Console:
    """What all pages share.

    Attributes:
        state: The newest of everything heard.
        desk: The work on the cell.
        lease: Who commands.
        log: Of all commands.
        store: Recorded examples.
        policy: Who may see and command.
        feed: Pictures and sections for the pages.
    """

    state: CellState
    desk: Desk
    lease: OperatorLease
    log: CommandLog
    store: ExampleStore
    policy: AccessPolicy
    feed: LiveFeed

    def links(self) -> dict[str, str]:
        """Addresses to open, by role."""
        host = "localhost" if self.policy.host in ("0.0.0.0", "::") else self.policy.host
        host = f"[{host}]" if ":" in host else host
        address = f"http://{host}:{self.policy.port}/"
        tokens = self.policy.tokens
        if tokens is None:
            return {"operator": address}
        return {
            "operator": f"{address}?token={tokens.operator}",
            "viewer": f"{address}?token={tokens.viewer}",
        }
