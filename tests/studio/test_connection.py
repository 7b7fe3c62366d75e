"""Connections of the studio that never finish a request: closed after a time, never carried out."""

import asyncio
import socket
import threading
import time

import pytest
import uvicorn
from starlette.responses import PlainTextResponse

from wm_drake.studio import guard
from wm_drake.studio.guard import Guard, TimedConnection

TOKEN, SECONDS = "token", 0.3


@pytest.fixture
def served(monkeypatch):
    """Yield the port of a guarded server, the bodies that reached what it guards, and the server."""
    monkeypatch.setattr(guard, "HEAD_TIMEOUT", SECONDS)
    monkeypatch.setattr(guard, "BODY_TIMEOUT", SECONDS)
    bodies = []

    async def application(scope, receive, send):
        bodies.append((await receive())["body"])
        await asyncio.sleep(60.0 if bodies == [b"long"] else 0.0)
        await PlainTextResponse("done")(scope, receive, send)

    listening = socket.create_server(("127.0.0.1", 0))
    port = listening.getsockname()[1]
    app = Guard(application, TOKEN, port)
    options = {"http": TimedConnection, "log_level": "error", "lifespan": "off"}
    config = uvicorn.Config(app, timeout_graceful_shutdown=1, **options)
    server = uvicorn.Server(config)
    thread = threading.Thread(target=lambda: asyncio.run(server.serve([listening])))
    thread.start()
    yield port, bodies, server
    server.should_exit = True
    thread.join()


def head(port, length):
    return (
        f"POST /{TOKEN}/x HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nContent-Type: application/json\r\n"
        f"Content-Length: {length}\r\n\r\n"
    ).encode()


def received(client):
    """Return all that arrives until the server closes the connection."""
    client.settimeout(20.0)
    return b"".join(iter(lambda: client.recv(1000), b""))


def test_half_open_requests_are_closed(served):
    port, bodies, _ = served
    begin = time.monotonic()
    sent = [b"", b"GET / HT", head(port, 5)[:-2], head(port, 5) + b"{}", head(port, 2) + b"{}GET /"]
    clients = [socket.create_connection(("127.0.0.1", port)) for _ in sent]
    for client, text in zip(clients, sent, strict=True):
        client.sendall(text)
    answers = [received(client) for client in clients]
    assert time.monotonic() - begin > SECONDS
    assert answers[:3] == [b"", b"", b""]
    assert answers[3].startswith(b"HTTP/1.1 408")
    assert answers[4].startswith(b"HTTP/1.1 200")
    assert bodies == [b"{}"]


def test_body_that_was_cut_short_is_not_carried_out(served):
    port, bodies, _ = served
    with socket.create_connection(("127.0.0.1", port)) as client:
        client.sendall(head(port, 102) + b"{}")
    with socket.create_connection(("127.0.0.1", port)) as client:
        client.sendall(head(port, 3) + b"{ }")
        while not bodies:
            time.sleep(0.01)
    assert bodies == [b"{ }"]


def test_a_request_that_is_answered_when_the_studio_ends_leaves_no_traceback(served, capfd):
    port, bodies, server = served
    with socket.create_connection(("127.0.0.1", port)) as client:
        client.sendall(head(port, 4) + b"long")
        while not bodies:
            time.sleep(0.01)
        server.should_exit = True
        assert received(client).startswith(b"HTTP/1.1 503")
    assert "Traceback" not in capfd.readouterr().err
