"""The server of the pages: what it serves, to whom, and what becomes of those who do not keep up."""

import json
from collections.abc import Callable
from typing import Any

from thenar.drivers.errors import SettingError
from thenar.runtime.web.server import message


def test_a_page_its_files_and_the_newest_message_of_each_topic(
    serve: Callable[..., Any], hear: Callable[..., Any]
) -> None:
    client = serve()
    client.server.publish("build", lambda: message("build", name="first"))
    client.server.publish("frame", message("frame", number=1))
    client.server.publish("frame", lambda: message("frame", number=2))
    page = client.ask("/")
    assert (page.status, page.headers["Content-Type"]) == (200, "text/html; charset=utf-8")
    assert client.ask("/wire.js").headers["Content-Type"] == "text/javascript; charset=utf-8"
    with client.open() as live:
        assert hear(live) == {"topic": "build", "name": "first"}
        assert hear(live) == {"topic": "frame", "number": 2}
        client.server.publish("frame", message("frame", number=3))
        # What was sent on opening may come once more.
        first = ({"topic": "build", "name": "first"}, {"topic": "frame", "number": 2})
        while (told := hear(live)) != {"topic": "frame", "number": 3}:
            assert told in first


def test_a_page_gets_the_topics_that_it_names(serve: Callable[..., Any], hear: Callable[..., Any]) -> None:
    client = serve()
    for topic in ("build", "frame"):
        client.server.publish(topic, message(topic))
    with client.open("/live?topics=frame,health") as live:
        client.server.publish("build", message("build", number=2))
        client.server.publish("health", message("health"))
        while (told := hear(live)) != {"topic": "health"}:
            assert told == {"topic": "frame"}


def test_what_a_page_asks_for_is_handed_on_and_a_refusal_told(
    serve: Callable[..., Any], hear: Callable[..., Any]
) -> None:
    asked: list[object] = []

    def take(message: object) -> None:
        asked.append(message)
        raise SettingError("there is no disk")

    with serve(on_message=take).open() as live:
        live.send('{"do": "record", "name": "a"}')
        assert hear(live) == {"topic": "refused", "do": "record", "why": "there is no disk"}
        assert asked == [{"do": "record", "name": "a"}]
        for nothing in ("", "[]", "{}", '{"do": 1}', "[" * 5000):
            live.send(nothing)
            assert hear(live)["why"].startswith("the page sent an invalid message")
        assert len(asked) == 1


def test_a_closed_server_says_so_to_its_pages(serve: Callable[..., Any]) -> None:
    client = serve()
    with client.open() as live:
        client.server.close()
        client.server.close()
        assert list(live) == []
        assert live.close_code == 1001


def test_the_last_that_is_published_before_the_end_is_shown(
    serve: Callable[..., Any], hear: Callable[..., Any]
) -> None:
    """A page says how it ended, however soon the server ends then."""
    client = serve()
    with client.open() as live:
        client.server.publish("frame", b'{"topic":"frame","number":0}')
        assert hear(live)["number"] == 0
        for number in range(1, 200):
            client.server.publish("frame", b'{"topic":"frame","number":%d}' % number)
        client.server.close()
        while (told := hear(live))["number"] < 199:
            assert told["number"] > 0
        assert {json.loads(text)["number"] for text in live} <= {199}
