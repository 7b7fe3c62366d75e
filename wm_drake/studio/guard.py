"""Let only the page itself in: token in the path, own host, own origin, small bodies."""

import secrets
from typing import Any

from starlette.datastructures import Headers
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

LARGEST_BODY = 1 << 18
"""Largest body of a request. [byte]"""

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


class _TooLargeError(Exception):
    pass


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
        path = scope["path"][1 + len(self._token) :] or "/"
        inner = {**scope, "path": path, "raw_path": path.encode(), "root_path": ""}
        started = False

        async def sent(message: Message) -> None:
            nonlocal started
            if message["type"] == "http.response.start":
                started = True
                given = {name for name, _ in message["headers"]}
                message["headers"] = [
                    *message["headers"],
                    *(header for header in _HEADERS if header[0] not in given),
                ]
            await send(message)

        try:
            await self.app(inner, _counted(receive), sent)
        except _TooLargeError:
            if not started:
                await _refuse((413, "the body is too large"), scope, receive, send)

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
    headers: dict[str, Any] = {"connection": "close"} if status == 413 else {}
    await PlainTextResponse(reason, status, headers)(scope, receive, send)


def _counted(receive: Receive) -> Receive:
    """Return `receive` that refuses a body that grows too large, whatever length was declared."""
    total = 0

    async def counted() -> Message:
        nonlocal total
        message = await receive()
        total += len(message.get("body", b""))
        if total > LARGEST_BODY:
            raise _TooLargeError
        return message

    return counted
