"""What the page of a run is told: how the glove is, and the past."""

import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from threading import Thread
from typing import Any

import pytest
from msgspec.structs import replace

from thenar.drivers.emulated.lines import BoardSender, LineServer
from thenar.runtime import Build, Glove
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.live.recogniser import Moment
from thenar.runtime.published import LiveGrasp
from thenar.runtime.web import live as module
from thenar.runtime.web.live import LivePage
from thenar.runtime.web.server import Server

from ..conftest import eventually

NAMES = tuple(f"s{number}" for number in range(6))


def glove_of(folder: Path, port: str) -> Glove:
    names = json.dumps(NAMES)
    text = f'name = "bench"\n[[stream]]\nport = "{port}"\nrate_hz = 100\nswitches = {names}\n[stream.board]\n'
    return Glove(Build.load(folder), parse_harness(text, "bench"))


@contextmanager
def running(glove: Glove, page: LivePage) -> Iterator[None]:
    """Show the run of a glove."""

    def run() -> None:
        for moment in glove:
            page.show(moment)

    with glove:
        thread = Thread(target=run)
        thread.start()
        try:
            yield
        finally:
            glove.stop.set()
            thread.join()


def test_the_gloves_state_is_said_as_it_changes(
    folder: Path, serve: Callable[..., Any], hear: Callable[..., Any]
) -> None:
    client = serve()
    with ExitStack() as stack:
        line = stack.enter_context(LineServer())
        glove = glove_of(folder, line.port)
        page = LivePage(client.server, glove, folder)
        live = stack.enter_context(client.open("/live?topics=glove"))

        def until(words: str, level: str) -> None:
            while not (told := hear(live))["words"].startswith(words):
                assert told["topic"] == "glove"
            assert (told["is"], told["lasts_s"]) == (level, 3)

        with running(glove, page):
            until("sends nothing yet", "warn")
            with BoardSender(line.send, NAMES, (), 100):
                until("connected", "good")
            until("silent since ", "bad")
            with BoardSender(line.send, NAMES, (), 100):
                until("connected", "good")
                line.close()
                until(f"{glove.devices()[0].name} lost since ", "bad")
        # The run has ended; who comes later is not told that the glove is connected.
        eventually(lambda: first_words(client, hear).startswith("silent since "))


def first_words(client: Any, hear: Callable[..., Any]) -> str:
    """Return what a page that is opened now is told of the glove."""
    with client.open("/live?topics=glove") as live:
        return str(hear(live)["words"])


def test_a_glove_that_was_never_there_is_not_lost_since_some_time(
    folder: Path, serve: Callable[..., Any], hear: Callable[..., Any]
) -> None:
    client, glove = serve(), glove_of(folder, "tcp://127.0.0.1:1")
    page = LivePage(client.server, glove, folder)
    with running(glove, page), client.open("/live?topics=glove") as live:
        assert hear(live)["words"] == f"{glove.devices()[0].name} not connected"
        assert hear(live)["words"] == f"{glove.devices()[0].name} not connected"


def told_past(server: Server) -> dict[str, Any]:
    made = server._latest["past"]
    assert callable(made)
    found: dict[str, Any] = json.loads(made())
    return found


def test_the_past_holds_changes_alone_and_marks_silence(
    folder: Path, serve: Callable[..., Any], make_grasp: Callable[..., LiveGrasp], monkeypatch: pytest.MonkeyPatch
) -> None:
    server, glove = serve().server, glove_of(folder, "tcp://127.0.0.1:1")
    page = LivePage(server, glove, folder)
    grasp = replace(make_grasp(), grasp="hook", health="ok", state="none", segment_us=None)
    seconds: tuple[tuple[float, dict[str, Any]], ...] = (
        (1.0, {}),
        (1.1, {"candidate": "pinch", "health": "changing"}),
        (1.2, {"state": "forming", "segment_us": 1_150_000, "segment_type": "hook"}),
        (1.3, {"state": "held", "segment_us": 1_150_000, "segment_type": "hook"}),
        (1.4, {"state": "releasing", "segment_us": 1_150_000, "segment_type": "hook", "health": "degraded"}),
        (9.0, {}),
    )
    for time_s, changes in seconds:
        moment = replace(grasp, time_us=round(1e6 * time_s), **changes)
        page.show(Moment(moment, None, None, None))
    assert told_past(server) == {
        "topic": "past",
        "until_us": 9_000_000,
        "changes": [
            [1_000_000, "hook", "", "", None],
            [1_300_000, "hook", "", "hook", 1_150_000],
            [1_400_000, "hook", "degraded", "hook", 1_150_000],
            [1_400_000, "", "", "", None],
            [9_000_000, "hook", "", "", None],
        ],
    }
    # Another build goes on with it; and it has an end.
    after = LivePage(server, glove, folder, page)
    assert len(told_past(server)["changes"]) == 5
    for number in range(2 * module._MOST_CHANGES):
        kind = ("hook", "pinch")[number % 2]
        after.show(Moment(replace(grasp, time_us=10_000_000 + number, grasp=kind), None, None, None))
    assert len(told_past(server)["changes"]) == module._MOST_CHANGES
