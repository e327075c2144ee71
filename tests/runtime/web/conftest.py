"""A server, and clients that speak HTTP and WebSocket to it as a browser does, or as an attacker."""

import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from http.client import HTTPConnection, HTTPResponse
from typing import Any
from urllib.parse import urlsplit

import pytest
from websockets.sync.client import ClientConnection, connect

from thenar.runtime.web.server import Server

PATIENCE_S = 20


class Client:
    """Speaks to a server."""

    def __init__(self, server: Server) -> None:
        parts = urlsplit(server.url)
        assert parts.hostname is not None
        assert parts.port is not None
        self.server, self.host, self.port = server, parts.hostname, parts.port
        self.origin = f"http://{parts.netloc}"

    def ask(self, path: str = "/", *, method: str = "GET", body: bytes | None = None, **headers: str) -> HTTPResponse:
        """Return the answer to a request, whose content is `.content`."""
        connection = HTTPConnection(self.host, self.port, timeout=PATIENCE_S)
        given = {name.replace("_", "-"): value for name, value in headers.items()}
        try:
            connection.request(method, path, body=body, headers=given)
            answer = connection.getresponse()
            answer.content = answer.read()  # type: ignore[attr-defined]
        finally:
            connection.close()
        return answer

    def open(self, path: str = "/live", **options: Any) -> ClientConnection:
        """Return a WebSocket as a page opens it."""
        options = {"origin": self.origin, "compression": None, "open_timeout": PATIENCE_S, "proxy": None} | options
        return connect(f"ws://{self.host}:{self.port}{path}", **options)


def told(live: ClientConnection) -> dict[str, Any]:
    """Return the next message."""
    message: dict[str, Any] = json.loads(live.recv(timeout=PATIENCE_S))
    return message


@pytest.fixture
def serve() -> Iterator[Callable[..., Client]]:
    """Return what starts a server on a free port and gives a client of it."""
    with ExitStack() as stack:

        def start(page: str = "live", address: str = "127.0.0.1:0", **options: Any) -> Client:
            return Client(stack.enter_context(Server(page, address, **{"token": None} | options)))

        yield start


@pytest.fixture
def visit() -> Callable[[Server], Client]:
    """Return what gives a client of a server."""
    return Client


@pytest.fixture
def hear() -> Callable[[ClientConnection], dict[str, Any]]:
    return told
