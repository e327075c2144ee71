"""Keys pressed on pages of a guide that several browsers may have open."""

import json
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from thenar.drivers.errors import SettingError
from thenar.runtime.recording.guide import KEYS
from thenar.runtime.web.guided import GuidePage


class Guide:
    """A guide that every key brings to its next step."""

    def __init__(self, step: int) -> None:
        self.step, self.pressed = step, list[str]()

    def press(self, _now_us: int, key: str) -> None:
        self.step += 1
        self.pressed.append(key)


@pytest.fixture
def page() -> Iterator[GuidePage]:
    with GuidePage("127.0.0.1:0", token=None, keys=KEYS, view=lambda *_: {}, about={}, hands={}) as made:
        yield made


@pytest.mark.parametrize(
    "asked",
    [
        {"do": "accept"},
        {"do": "accept", "step": "1"},
        {"do": "accept", "step": True},
        {"do": "accept", "step": 1.0},
        {"do": "format", "step": 1},
        {"do": "ACCEPT", "step": 1},
    ],
)
def test_what_is_no_press_is_refused(page: GuidePage, asked: dict[str, object]) -> None:
    guide = Guide(1)
    with pytest.raises(SettingError, match="this page presses accept, redo, undo, skip, pause, quit, each at a step"):
        page._take(asked)
    page.press(0, guide)
    assert guide.pressed == []


def test_a_key_counts_once_at_its_own_step(page: GuidePage) -> None:
    """Two browsers press at once: after the first the step is another."""
    guide = Guide(7)
    for name, meant in (("accept", 7), ("accept", 7), ("undo", 8), ("undo", 8), ("quit", 6)):
        page._take({"do": name, "step": meant})
    page.press(0, guide)
    assert guide.pressed == ["accept", "undo"]
    page.press(0, guide)
    assert guide.pressed == ["accept", "undo"]


def test_the_pages_of_the_server_press(page: GuidePage, visit: Callable[..., Any], hear: Callable[..., Any]) -> None:
    guide = Guide(9)
    with visit(SimpleNamespace(url=page.url)).open() as live:
        told = [hear(live)["topic"] for _ in range(2)]
        assert told == ["about", "hands"]
        live.send('{"do": "skip", "step": "9"}')
        assert hear(live)["topic"] == "refused"
        live.send('{"do": "skip", "step": 9}')
        live.send('{"do": "dance", "step": 9}')
        assert hear(live)["do"] == "dance"
    page.press(0, guide)
    assert guide.pressed == ["skip"]


def test_the_last_that_is_published_before_the_end_is_shown(
    serve: Callable[..., Any], hear: Callable[..., Any]
) -> None:
    """A page says how it ended, however soon the server ends then."""
    client = serve("guided")
    with client.open() as live:
        client.server.publish("guide", b'{"topic":"guide","number":0}')
        assert hear(live)["number"] == 0
        for number in range(1, 200):
            client.server.publish("guide", b'{"topic":"guide","number":%d}' % number)
        client.server.close()
        while (told := hear(live))["number"] < 199:
            assert told["number"] > 0
        assert {json.loads(text)["number"] for text in live} <= {199}
