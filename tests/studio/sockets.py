"""The WebSocket of the studio's pages, as a test or an attacker uses it without a browser."""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from thenar.studio.studio import Studio

PATIENCE_S = 30


@contextmanager
def page(url: str, topics: str = "none") -> Iterator[ClientConnection]:
    """Yield the connection of a page that shows these topics."""
    address = url.removeprefix("http://").rstrip("/")
    with connect(f"ws://{address}/live?topics={topics}", origin=Origin(f"http://{address}"), proxy=None) as live:
        yield live


def until(live: ClientConnection, fits: Callable[[dict[str, Any]], object]) -> dict[str, Any]:
    """Return the first message that fits."""
    while not fits(told := json.loads(live.recv(timeout=PATIENCE_S))):
        pass
    return dict(told)


def reply(opened: Studio, request: dict[str, Any], topic: str = "none", *parts: str) -> dict[str, Any]:
    """Return the first message of a topic, with these parts, or the refusal, after a request."""
    with page(opened.server.url, topic) as live:
        live.send(json.dumps(request))
        return until(
            live,
            lambda told: told["topic"] == "refused" or (told["topic"] == topic and {*parts} <= {*told}),
        )
