"""A server, and clients that speak HTTP and WebSocket to it as a browser does, or as an attacker; a build's folder."""

import hashlib
import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from http.client import HTTPConnection, HTTPResponse
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from msgspec.structs import replace
from websockets.sync.client import ClientConnection, connect

from thenar.compiler.hand import grid_hand
from thenar.runtime import Build
from thenar.runtime.build import MANIFEST_NAME, TABLES_NAME
from thenar.runtime.hand import HAND_NAME, hand_to_bytes
from thenar.runtime.manifest_file import manifest_to_bytes
from thenar.runtime.model.integers import tables_to_bytes
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


@pytest.fixture
def folder(make_build: Callable[..., Build], tmp_path: Path) -> Path:
    """Return the folder of a build of six switches, s0 to s5."""
    build = make_build(joints=0)
    hand = hand_to_bytes(grid_hand(build.manifest))
    manifest = replace(build.manifest, hand_sha256=hashlib.sha256(hand).hexdigest())
    (tmp_path / TABLES_NAME).write_bytes(tables_to_bytes(build.tables))
    (tmp_path / HAND_NAME).write_bytes(hand)
    (tmp_path / MANIFEST_NAME).write_bytes(manifest_to_bytes(manifest))
    return tmp_path
