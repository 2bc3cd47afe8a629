"""Who may see and who may command: tokens, roles, and whose request is believed."""

from __future__ import annotations

import hmac
import ipaddress
import secrets
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from urllib.parse import urlsplit

from emd_core.errors import InvalidInputError

COOKIE = "emd_console"
_SHORTEST = 16


class Role(StrEnum):
    """What a visitor may do."""

    OPERATOR = "operator"
    VIEWER = "viewer"


@dataclass(frozen=True)
class Tokens:
    """Secrets that make a visitor operator or viewer.

    Attributes:
        operator: May command the cell.
        viewer: May look.
    """

    operator: str = field(default_factory=lambda: secrets.token_urlsafe(24), repr=False)
    viewer: str = field(default_factory=lambda: secrets.token_urlsafe(24), repr=False)

    def __post_init__(self) -> None:
        """Check them.

        Raises:
            InvalidInputError: If one is short, or both are the same.
        """
        if min(len(self.operator), len(self.viewer)) < _SHORTEST:
            raise InvalidInputError(f"a token needs at least {_SHORTEST} characters")
        if self.operator == self.viewer:
            raise InvalidInputError("operator and viewer need different tokens, got the same")

    def role(self, token: str | None) -> Role | None:
        """Whose token it is; compared in constant time."""
        if not token:
            return None
        given = token.encode(errors="replace")
        for role, wanted in ((Role.OPERATOR, self.operator), (Role.VIEWER, self.viewer)):
            if hmac.compare_digest(given, wanted.encode()):
                return role
        return None


@dataclass(frozen=True)
class AccessPolicy:
    """Decides about every request.

    Attributes:
        host: Address on which the console listens.
        port: Its port.
        tokens: What visitors must show; None: everybody on this machine is an operator.
    """

    host: str
    port: int
    tokens: Tokens | None = None

    def __post_init__(self) -> None:
        """Check that nobody from outside is let in without a token.

        Raises:
            InvalidInputError: If the host is no address of this machine alone and there are no
                tokens.
        """
        if self.tokens is None and not is_loopback(self.host):
            raise InvalidInputError(
                f"{self.host} can be reached from other machines, which needs tokens; listen on "
                "127.0.0.1, or let the console make tokens"
            )

    def role(self, token: str | None) -> Role | None:
        """What somebody with this token may do; None: not even see."""
        return Role.OPERATOR if self.tokens is None else self.tokens.role(token)

    def believes(self, headers: Mapping[str, str]) -> bool:
        """Whether a request comes from a page of this console, or from no page at all.

        A browser names the page's origin with every socket and every form that a page of another
        site sends; and a name that was bent to this address shows in Host.

        Args:
            headers: In lower case.
        """
        if self.tokens is None and not is_loopback(_host_name(headers.get("host", ""))):
            return False
        origin = headers.get("origin")
        return origin is None or urlsplit(origin).netloc == headers.get("host", "")


def is_loopback(host: str) -> bool:
    """Whether a host is this machine as only itself can name it."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _host_name(host: str) -> str:
    """The host of a Host header, without port and brackets."""
    return urlsplit(f"//{host}").hostname or ""
