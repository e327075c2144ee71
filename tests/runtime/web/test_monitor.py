"""The page of a run elsewhere: what its socket delivers is what the page gets."""

import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread
from typing import Any

import pytest
from websockets.sync.client import connect
from websockets.typing import Origin

from thenar.drivers.errors import SettingError
from thenar.runtime.published import DeviceHealth, HealthReport, LiveGrasp
from thenar.runtime.sinks.base import open_sink
from thenar.runtime.web import monitor
from thenar.runtime.web.monitor import MonitoredStream, StreamMonitor

NAME = "<script>alert(1)</script>"


def grasp(number: int) -> LiveGrasp:
    return LiveGrasp(
        time_us=10_000 * number,
        unix_us=0,
        number=number,
        grasp=NAME,
        candidate="PoS",
        probability=0.5,
        margin=1,
        health="ok",
        switch_age_us=1,
        glove_age_us=None,
        latency_us=1,
    )


HEALTH = HealthReport(1, (), (), (), (), 0.0, 0.0, 1, 0, 0, 0, devices=(DeviceHealth("board", connected=True),))


@contextmanager
def shown(where: str, said: list[MonitoredStream]) -> Iterator[StreamMonitor]:
    stop = Event()
    with StreamMonitor(where, "127.0.0.1:0", token=None) as made:
        thread = Thread(target=made.run, args=(stop, said.append))
        thread.start()
        try:
            yield made
        finally:
            stop.set()
            thread.join()


@contextmanager
def page(made: StreamMonitor) -> Iterator[Any]:
    where = made.server.url.removeprefix("http://")
    with connect(f"ws://{where}live", origin=Origin(f"http://{where.rstrip('/')}"), proxy=None) as live:
        yield live


def hear(live: Any, told: Callable[[Any], dict[str, Any]], wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    while not wanted(found := told(live)):
        pass
    return found


@pytest.mark.parametrize("kind", ["unix", "tcp"])
def test_a_page_gets_what_the_run_publishes(kind: str, tmp_path: Path, hear_one: Any) -> None:
    sink: Any = open_sink(f"unix:{tmp_path}/run" if kind == "unix" else "tcp:127.0.0.1:0")
    where = f"unix:{tmp_path}/run" if kind == "unix" else f"tcp:127.0.0.1:{sink.address[1]}"
    said: list[MonitoredStream] = []
    with shown(where, said) as made, page(made) as live:
        first = hear_one(live)
        assert (first["topic"], first["name"], first["records"], first["partial"]) == ("build", where, False, True)
        number = 0

        def published(told: dict[str, Any]) -> bool:
            nonlocal number
            number += 1
            sink.publish(grasp(number), None, None)
            sink.health(HEALTH)
            return bool(told["topic"] == "frame")

        sink.publish(grasp(0), None, None)
        hear(live, hear_one, lambda told: told.get("connected") is True)
        sink.publish(grasp(1), None, None)
        found = hear(live, hear_one, published)
        assert (found["grasp"], found["candidate"], found["probability"]) == (NAME, "PoS", 0.5)
        assert hear(live, hear_one, lambda told: told["topic"] == "health")["devices"][0]["name"] == "board"
        sink.close()
        gone = hear(live, hear_one, lambda told: told["topic"] == "source" and not told["connected"])
        assert gone["error"]
        with page(made) as late:
            past = hear(late, hear_one, lambda told: told["topic"] == "past")
            assert past["changes"][0][1:3] == ["PoS", NAME]
    assert said[0] == MonitoredStream(where, connected=True)


def test_a_run_that_comes_later_is_found(tmp_path: Path, hear_one: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(monitor, "RETRY_S", 0.02)
    where = f"unix:{tmp_path}/run"
    with shown(where, []) as made, page(made) as live:
        lacking = hear(live, hear_one, lambda told: told["topic"] == "source" and told["error"].startswith(where))
        assert lacking["error"].endswith(f"is the run going, with --sink {where}?")
        sink = open_sink(where)
        sink.publish(grasp(1), None, None)
        assert hear(live, hear_one, lambda told: told["topic"] == "source" and told["connected"])
        sink.close()


@pytest.mark.parametrize("sent", [b"no json\n", b'{"kind":"grasp"}\n', b"[" * 100_000 + b"\n", b"x" * (2 << 20)])
def test_what_is_no_stream_is_said_and_ends_nothing(sent: bytes, tmp_path: Path, hear_one: Any) -> None:
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(f"{tmp_path}/run")
        listener.listen()

        def send() -> None:
            with listener.accept()[0] as other:
                other.settimeout(10)
                try:
                    other.sendall(sent)
                    other.recv(1)
                except OSError:
                    pass

        thread = Thread(target=send)
        thread.start()
        with shown(f"unix:{tmp_path}/run", []) as made, page(made) as live:
            found = hear(live, hear_one, lambda told: "not a stream of thenar" in told.get("error", ""))
            assert len(found["error"]) < 300
            thread.join()


@pytest.mark.parametrize("where", ["tcp:", "unix:", "tcp:host", "tcp:host:99999", "http://x", "", "ros:/thenar"])
def test_what_names_no_stream_is_refused(where: str) -> None:
    with pytest.raises(SettingError, match="is not a stream of a run: write tcp:HOST:PORT or unix:PATH"):
        StreamMonitor(where, "127.0.0.1:0", token=None)
