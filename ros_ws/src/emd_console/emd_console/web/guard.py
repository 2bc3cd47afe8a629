"""Stands before every request: no token, no page; no foreign origin; no large bodies."""

from __future__ import annotations

import secrets
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qsl, urlencode

from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from emd_console.access import COOKIE, AccessPolicy, is_loopback

ROLE = "emd_role"
VISITOR = "emd_visitor"
LARGEST_BODY = 512 * 1024
_HEADERS = [
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"x-frame-options", b"DENY"),
    (
        b"content-security-policy",
        b"default-src 'self' 'unsafe-inline' 'unsafe-eval'; img-src 'self' data: blob:; "
        b"connect-src 'self'; font-src 'self' data:; frame-ancestors 'none'; base-uri 'self'",
    ),
]


class Guard:
    """ASGI middleware.

    What passes has its role in `scope["emd_role"]` and the name of its browser, from a cookie, in
    `scope["emd_visitor"]`.
    """

    def __init__(self, app: ASGIApp, policy: AccessPolicy) -> None:
        """Let through to `app` what `policy` allows."""
        self._app = app
        self._policy = policy

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request or socket."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = _headers(scope)
        if not self._policy.believes(headers):
            await _refuse(scope, receive, send, 403, "this does not come from the console's page")
            return
        query = dict(parse_qsl(scope.get("query_string", b"").decode("latin-1")))
        token = query.get("token")
        role = self._policy.role(token if token is not None else _cookie(headers, COOKIE))
        if role is None:
            text = "a link with a token is needed; the console printed it when it started"
            await _refuse(scope, receive, send, 401, text)
            return
        if token is not None and scope["type"] == "http" and scope["method"] == "GET":
            await _keep_token(scope, token, query)(scope, receive, send)
            return
        if _too_large(headers):
            await _refuse(scope, receive, send, 413, f"at most {LARGEST_BODY} bytes are taken")
            return
        known = _cookie(headers, VISITOR)
        if _is_local(scope):
            scope = _uncompressed(scope)
        scope[ROLE], scope[VISITOR] = role, known or secrets.token_hex(16)
        fresh = None if known else scope[VISITOR]
        await self._app(scope, _bounded(receive), _with_headers(send, fresh))


def _headers(scope: Scope) -> dict[str, str]:
    return {
        name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]
    }


def _cookie(headers: dict[str, str], name: str) -> str | None:
    try:
        found = SimpleCookie(headers.get("cookie", "")).get(name)
    except CookieError:
        return None
    return found.value if found else None


def _keep_token(scope: Scope, token: str, query: dict[str, str]) -> RedirectResponse:
    """Put the token into a cookie, so that it does not stay in the address."""
    rest = urlencode({name: value for name, value in query.items() if name != "token"})
    path = "/" + scope["path"].lstrip("/")  # never the address of another host
    response = RedirectResponse(f"{path}?{rest}" if rest else path, status_code=303)
    response.set_cookie(COOKIE, token, httponly=True, samesite="strict", path="/")
    return response


def _is_local(scope: Scope) -> bool:
    client = scope.get("client")
    return client is not None and is_loopback(client[0])


def _uncompressed(scope: Scope) -> Scope:
    """Let nothing be compressed on its way to this machine itself, which would only take time."""
    kept = [item for item in scope["headers"] if item[0] != b"accept-encoding"]
    return {**scope, "headers": kept}


def _too_large(headers: dict[str, str]) -> bool:
    length = headers.get("content-length", "0")
    return not length.isdigit() or int(length) > LARGEST_BODY


def _bounded(receive: Receive) -> Receive:
    """Cut off bodies that are longer than they may be, whatever their headers say."""
    taken = 0

    async def bounded() -> Message:
        nonlocal taken
        message = await receive()
        if message["type"] == "http.request":
            taken += len(message.get("body", b""))
            if taken > LARGEST_BODY:
                return {"type": "http.disconnect"}
        return message

    return bounded


def _with_headers(send: Send, visitor: str | None) -> Send:
    """Add the headers of every answer, and a cookie for a browser that has no name yet."""
    cookie = f"{VISITOR}={visitor}; Path=/; HttpOnly; SameSite=Strict"
    more = [*_HEADERS, *([(b"set-cookie", cookie.encode())] if visitor else [])]

    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            message = {**message, "headers": [*message.get("headers", []), *more]}
        await send(message)

    return sending


async def _refuse(scope: Scope, receive: Receive, send: Send, status: int, text: str) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 1008, "reason": text})
        return
    response: Any = PlainTextResponse(text + "\n", status_code=status)
    await response(scope, receive, send)
