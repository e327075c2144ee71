"""What the page of a run is told: how the glove is, and the past."""

import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from threading import Thread
from time import time
from typing import Any

import pytest
from msgspec.structs import replace

from thenar.drivers.emulated.lines import BoardSender, LineServer
from thenar.runtime import Build, Glove
from thenar.runtime.frames import now_us
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.live.recogniser import Moment
from thenar.runtime.published import LiveGrasp
from thenar.runtime.web import live as module
from thenar.runtime.web.live import LivePage
from thenar.runtime.web.server import Server

from ..conftest import eventually

NAMES = tuple(f"s{number}" for number in range(6))


def glove_of(folder: Path, port: str, rate_hz: float = 100) -> Glove:
    names = json.dumps(NAMES)
    text = f'name = "bench"\n[[stream]]\nport = "{port}"\nrate_hz = {rate_hz}\nswitches = {names}\n[stream.board]\n'
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


@pytest.mark.parametrize(("rate_hz", "least_s", "most_s"), [(100, 0.5, 0.5), (0.5, 6.0, 6.5)])
def test_pages_are_told_how_long_a_moment_is_current(
    folder: Path, serve: Callable[..., Any], hear: Callable[..., Any], rate_hz: float, least_s: float, most_s: float
) -> None:
    """For half a second, or for three periods of a slow source; silences of the past are as long."""
    client, glove = serve(), glove_of(folder, "tcp://127.0.0.1:1", rate_hz)
    page = LivePage(client.server, glove, folder)
    with client.open("/live?topics=build") as live:
        silent_us = hear(live)["silent_us"]
    assert least_s <= silent_us / 1e6 <= most_s
    for time_us in (0, silent_us, 2 * silent_us + 1):
        page._past.take((time_us, "hook", "", "", None))
    assert [(time_us, kind) for time_us, kind, *_ in page._past.changes] == [
        (0, "hook"),
        (silent_us, ""),
        (2 * silent_us + 1, "hook"),
    ]


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
    clock_us = page._clock_us
    for time_s, changes in seconds:
        time_us = round(1e6 * time_s)
        page.show(Moment(replace(grasp, time_us=time_us, unix_us=clock_us + time_us, **changes), None, None, None))
    assert time() - 1e-6 * (clock_us + now_us()) == pytest.approx(0, abs=1)
    assert told_past(server) == {
        "topic": "past",
        "until_us": clock_us + 9_000_000,
        "changes": [
            [clock_us + 1_000_000, "hook", "", "", None],
            [clock_us + 1_300_000, "hook", "", "hook", clock_us + 1_150_000],
            [clock_us + 1_400_000, "hook", "degraded", "hook", clock_us + 1_150_000],
            [clock_us + 1_400_000, "", "", "", None],
            [clock_us + 9_000_000, "hook", "", "", None],
        ],
    }
    # Another build goes on with it; and it has an end.
    after = LivePage(server, glove, folder, page)
    assert len(told_past(server)["changes"]) == 5
    for number in range(2 * module._MOST_CHANGES):
        kind, time_us = ("hook", "pinch")[number % 2], 10_000_000 + number
        moment = replace(grasp, time_us=time_us, unix_us=after._clock_us + time_us, grasp=kind)
        after.show(Moment(moment, None, None, None))
    assert len(told_past(server)["changes"]) == module._MOST_CHANGES


def test_times_follow_a_clock_that_is_set(
    folder: Path, serve: Callable[..., Any], make_grasp: Callable[..., LiveGrasp]
) -> None:
    """An hour later the past goes on; an hour earlier it begins anew; a drift of less than a second changes none."""
    server, glove = serve().server, glove_of(folder, "tcp://127.0.0.1:1")
    page = LivePage(server, glove, folder)
    grasp, begun_us = replace(make_grasp(), health="ok", state="none", segment_us=None), page._clock_us
    hour_us, found = 3_600_000_000, list[list[tuple[int, str]]]()
    shown = (("hook", 0), ("pinch", hour_us), ("hook", hour_us + 999_999), ("pinch", 0))
    for number, (kind, set_us) in enumerate(shown):
        time_us = 100_000 * (1 + number)
        moment = replace(grasp, grasp=kind, time_us=time_us, unix_us=begun_us + time_us + set_us)
        page.show(Moment(moment, None, None, None))
        found.append([(change[0] - begun_us, change[1]) for change in told_past(server)["changes"]])
    first, silence = (100_000, "hook"), (100_000, "")
    assert found[1] == [first, silence, (hour_us + 200_000, "pinch")]
    assert found[2] == [*found[1], (hour_us + 300_000, "hook")]
    assert found[3] == [(400_000, "pinch")]
