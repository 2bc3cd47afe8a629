"""What reaches the pages, and what does not."""

import asyncio
from typing import Any

import pytest

from emd_console.access import AccessPolicy, Role, Tokens
from emd_console.web.guard import LARGEST_BODY, ROLE, VISITOR, Guard

HOST = "cell.example:8765"
TOKENS = Tokens("operator-of-the-test", "viewer-of-the-test")


class Visit:
    """One request or socket through a guard, and what came of it."""

    def __init__(self, kind: str = "http", policy: AccessPolicy | None = None, **change: Any):
        """Send it; `change` replaces parts: method, path, query, headers, body."""
        headers = {"host": HOST, **change.get("headers", {})}
        self.scope: dict[str, Any] = {
            "type": kind,
            "method": change.get("method", "GET"),
            "path": change.get("path", "/"),
            "client": change.get("client"),
            "query_string": change.get("query", "").encode(),
            "headers": [(k.encode("latin-1"), v.encode("latin-1")) for k, v in headers.items()],
        }
        self.sent: list[dict[str, Any]] = []
        self.reached: dict[str, Any] | None = None
        self.bodies = list(change.get("body", [b""]))
        guard = Guard(self._app, policy or AccessPolicy("0.0.0.0", 8765, TOKENS))
        asyncio.run(guard(self.scope, self._receive, self._send))

    async def _app(self, scope: Any, receive: Any, send: Any) -> None:
        self.reached = scope
        self.taken = 0
        while self.bodies:
            message = await receive()
            if message["type"] == "http.disconnect":
                return
            self.taken += len(message.get("body", b""))
        if scope["type"] == "http":
            await send({"type": "http.response.start", "status": 200, "headers": []})

    async def _receive(self) -> dict[str, Any]:
        if self.scope["type"] == "websocket":
            self.bodies = []
            return {"type": "websocket.connect"}
        return {"type": "http.request", "body": self.bodies.pop(0), "more_body": True}

    async def _send(self, message: Any) -> None:
        self.sent.append(message)

    @property
    def status(self) -> int:
        """Of the answer."""
        return int(self.sent[0].get("status", self.sent[0].get("code", 0)))

    def header(self, name: str) -> str:
        """Of the answer; several of one name joined."""
        found = [v.decode() for k, v in self.sent[0]["headers"] if k.decode() == name]
        return "; ".join(found)


def cookie(token: str) -> dict[str, str]:
    """Headers of a browser that has a token."""
    return {"cookie": f"emd_console={token}"}


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize(
    "change",
    [
        {},
        {"query": "token=wrong"},
        {"query": "token="},
        {"headers": cookie("wrong")},
        {"headers": {"cookie": "emd_console"}},
        {"headers": {"cookie": '"\\]=;;='}},
        {"query": "token=wrong", "headers": cookie(TOKENS.operator)},
    ],
)
def test_without_a_right_token_nothing_is_reached(kind, change) -> None:
    """Neither pages nor sockets, and the answer tells nothing of the cell."""
    visit = Visit(kind, **change)
    assert visit.reached is None and visit.status in (401, 1008)


def test_a_token_in_the_address_moves_into_a_cookie() -> None:
    """Scripts cannot read it, other sites do not send it, and the address is clean."""
    visit = Visit(path="//evil.example/review", query=f"token={TOKENS.viewer}&a=1")
    assert visit.reached is None and visit.status == 303
    assert visit.header("location") == "/evil.example/review?a=1"
    kept = visit.header("set-cookie")
    assert TOKENS.viewer in kept and "HttpOnly" in kept and "samesite=strict" in kept.lower()


@pytest.mark.parametrize(("token", "role"), [("operator", Role.OPERATOR), ("viewer", Role.VIEWER)])
def test_a_right_token_reaches_with_its_role(token, role) -> None:
    """And the browser gets a name to be told from others."""
    visit = Visit(headers=cookie(getattr(TOKENS, token)))
    assert visit.reached is not None and visit.reached[ROLE] is role
    assert visit.reached[VISITOR] in visit.header("set-cookie")
    assert "frame-ancestors 'none'" in visit.header("content-security-policy")


@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_a_foreign_origin_reaches_nothing_even_with_a_token(kind) -> None:
    """A page of another site in the operator's browser cannot command the cell."""
    headers = {**cookie(TOKENS.operator), "origin": "http://evil.example"}
    assert Visit(kind, headers=headers).reached is None
    own = {**cookie(TOKENS.operator), "origin": f"http://{HOST}"}
    assert Visit(kind, headers=own).reached is not None


def test_large_bodies_are_cut_off_whatever_their_headers_say() -> None:
    """By the length they claim, and by the length they have."""
    headers = cookie(TOKENS.operator)
    claimed = Visit(method="POST", headers={**headers, "content-length": str(LARGEST_BODY + 1)})
    assert claimed.reached is None and claimed.status == 413
    odd = Visit(method="POST", headers={**headers, "content-length": "-1"})
    assert odd.reached is None
    streamed = Visit(method="POST", headers=headers, body=[b"x" * 100_000] * 10)
    assert streamed.taken <= LARGEST_BODY


def test_on_this_machine_no_token_is_needed_but_the_right_name() -> None:
    """A name of the world that was bent to 127.0.0.1 is not answered."""
    here = AccessPolicy("127.0.0.1", 8765)
    assert Visit(policy=here, headers={"host": "127.0.0.1:8765"}).reached is not None
    assert Visit(policy=here, headers={"host": "evil.example:8765"}).reached is None


@pytest.mark.parametrize(("address", "kept"), [("127.0.0.1", 0), ("192.0.2.7", 1)])
def test_nothing_is_compressed_for_this_machine_itself(address, kept) -> None:
    """A browser elsewhere may have it compressed."""
    headers = {**cookie(TOKENS.viewer), "accept-encoding": "gzip"}
    visit = Visit(headers=headers, client=(address, 50000))
    assert visit.reached is not None
    names = [name for name, _ in visit.reached["headers"]]
    assert names.count(b"accept-encoding") == kept and b"cookie" in names
