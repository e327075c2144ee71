import json
from collections.abc import Callable
from typing import Any

import pytest

from thenar.drivers.errors import SettingError
from thenar.runtime.recording.guide import Key
from thenar.runtime.web.presses import Presses


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
def test_what_is_no_press_is_refused(asked: dict[str, object]) -> None:
    presses = Presses(Key)
    with pytest.raises(SettingError, match="this page presses accept, redo, undo, skip, pause, quit, each at a step"):
        presses.take(asked)
    assert list(presses.due(lambda: 1)) == []


def test_a_key_counts_once_at_its_own_step() -> None:
    """Two browsers press at once: after the first the step is another."""
    presses, steps = Presses(Key), [7]
    for name, meant in (("accept", 7), ("accept", 7), ("undo", 8), ("undo", 8), ("quit", 6)):
        presses.take({"do": name, "step": meant})
    done = []
    for key in presses.due(lambda: steps[-1]):
        done.append(key)
        steps.append(steps[-1] + 1)
    assert done == [Key.ACCEPT, Key.UNDO]
    assert list(presses.due(lambda: steps[-1])) == []


def test_the_pages_of_the_server_press(serve: Callable[..., Any], hear: Callable[..., Any]) -> None:
    presses = Presses(Key)
    client = serve("collect", on_message=presses.take)
    with client.open() as live:
        live.send('{"do": "skip", "step": "9"}')
        assert hear(live)["topic"] == "refused"
        live.send('{"do": "skip", "step": 9}')
        live.send('{"do": "dance", "step": 9}')
        assert hear(live)["do"] == "dance"
    assert list(presses.due(lambda: 9)) == [Key.SKIP]


def test_the_last_that_is_published_before_the_end_is_shown(
    serve: Callable[..., Any], hear: Callable[..., Any]
) -> None:
    """A page says how it ended, however soon the server ends then."""
    client = serve("collect")
    with client.open() as live:
        client.server.publish("guide", b'{"topic":"guide","number":0}')
        assert hear(live)["number"] == 0
        for number in range(1, 200):
            client.server.publish("guide", b'{"topic":"guide","number":%d}' % number)
        client.server.close()
        while (told := hear(live))["number"] < 199:
            assert told["number"] > 0
        assert {json.loads(text)["number"] for text in live} <= {199}
