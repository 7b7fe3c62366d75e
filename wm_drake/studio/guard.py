"""Let only the page itself in: token in the path, own host and origin, small, quick requests."""

import asyncio
import secrets
from typing import Any

import h11
from starlette.datastructures import Headers
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

LARGEST_BODY = 1 << 18
"""Largest body of a request. [byte]"""

BODY_TIMEOUT = 2.0
"""Time in which the body of a request must arrive, from this computer. [s]"""

_HEADERS = (
    (
        b"content-security-policy",
        b"default-src 'self'; img-src 'self' data:; style-src 'self'; "
        b"base-uri 'none'; form-action 'none'; frame-ancestors 'none'; object-src 'none'",
    ),
    (b"referrer-policy", b"no-referrer"),
    (b"x-content-type-options", b"nosniff"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"cache-control", b"no-store"),
)


class Guard:
    """An ASGI application in front of another one.

    A request is let in if its path begins with the token, its host is this computer with the own
    port (a name that another site has pointed to this computer is another host), its origin, if it
    names one, is the page itself, and its body is small and JSON.
    """

    def __init__(self, app: ASGIApp, token: str, port: int) -> None:
        """Guard an application that is served at a port of this computer."""
        self.app, self._token = app, token
        self._hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or pass it on with the token taken from its path."""
        if scope["type"] != "http":
            if scope["type"] == "lifespan":
                await self.app(scope, receive, send)
            return
        refusal = self._refusal(scope)
        if refusal is not None:
            await _refuse(refusal, scope, receive, send)
            return
        try:
            async with asyncio.timeout(BODY_TIMEOUT):
                body = await _body(receive)
        except TimeoutError:
            await _refuse((408, "the body did not arrive in time"), scope, receive, send)
            return
        except _IncompleteError:  # even if its beginning happens to be a whole request
            await _refuse((400, "the body is not complete"), scope, receive, send)
            return
        if body is None:
            await _refuse((413, "the body is too large"), scope, receive, send)
            return
        path = scope["path"][1 + len(self._token) :] or "/"
        inner = {**scope, "path": path, "raw_path": path.encode(), "root_path": ""}
        try:
            await self.app(inner, _replayed(body, receive), _with_headers(send))
        except asyncio.CancelledError:  # the server ends; uvicorn would print a traceback
            await _refuse((503, "the studio has ended"), scope, receive, send)

    def _refusal(self, scope: Scope) -> tuple[int, str] | None:
        """Return status and reason if a request is not let in."""
        headers = Headers(scope=scope)
        if headers.get("host", "") not in self._hosts:
            return 403, "this host is not served"
        first = scope["path"].split("/")[1] if scope["path"].startswith("/") else ""
        if not secrets.compare_digest(first.encode(), self._token.encode()):
            return 404, "not found"
        origin = headers.get("origin")
        if origin is not None and origin not in {f"http://{host}" for host in self._hosts}:
            return 403, "this origin is not served"
        if scope["method"] in ("GET", "HEAD"):
            return None
        if scope["method"] != "POST":
            return 405, "allowed are GET and POST"
        if headers.get("content-type", "").split(";")[0].strip() != "application/json":
            return 415, "the body must be JSON"
        length = headers.get("content-length", "0")
        if not length.isdecimal() or int(length) > LARGEST_BODY:
            return 413, "the body is too large"
        return None


async def _refuse(refusal: tuple[int, str], scope: Scope, receive: Receive, send: Send) -> None:
    status, reason = refusal
    closes = status in (400, 408, 413)  # what follows on this connection has no known meaning
    headers: dict[str, Any] = {"connection": "close"} if closes else {}
    await PlainTextResponse(reason, status, headers)(scope, receive, send)


class _IncompleteError(Exception):
    """A connection ended before the body of its request."""


async def _body(receive: Receive) -> bytes | None:
    """Return the body of a request; None if it grows too large, whatever length was declared.

    Raises:
        _IncompleteError: the connection ended before the body did.
    """
    body, more = b"", True
    while more:
        message = await receive()
        if message["type"] == "http.disconnect":
            raise _IncompleteError
        body += message.get("body", b"")
        more = message.get("more_body", False)
        if len(body) > LARGEST_BODY:
            return None
    return body


def _replayed(body: bytes, receive: Receive) -> Receive:
    """Return a `receive` that gives a body that was read already, then all that follows."""
    given = False

    async def replayed() -> Message:
        nonlocal given
        if given:
            return await receive()
        given = True
        return {"type": "http.request", "body": body, "more_body": False}

    return replayed


def _with_headers(send: Send) -> Send:
    """Return a `send` that adds the headers that each response has."""

    async def sent(message: Message) -> None:
        if message["type"] == "http.response.start":
            given = {name for name, _ in message["headers"]}
            added = [header for header in _HEADERS if header[0] not in given]
            message["headers"] = [*message["headers"], *added]
        await send(message)

    return sent


HEAD_TIMEOUT = 2.0
"""Time in which the head of a request must arrive, from this computer. [s]"""


class TimedConnection(H11Protocol):
    """A connection of uvicorn that waits for the head of a request for a limited time.

    uvicorn itself waits for ever; it only limits the time between two requests.
    """

    _deadline: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to wait for the first request."""
        super().connection_made(transport)
        self._watch()

    def data_received(self, data: bytes) -> None:
        """Take data, and wait on if they do not complete the head of a request."""
        super().data_received(data)
        self._watch()

    def connection_lost(self, exc: Exception | None) -> None:
        """Wait no longer."""
        self._forget()
        super().connection_lost(exc)

    def _watch(self) -> None:
        if self.conn.their_state is not h11.IDLE:
            self._forget()
        elif self._deadline is None:
            self._deadline = self.loop.call_later(HEAD_TIMEOUT, self.transport.close)

    def _forget(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None
