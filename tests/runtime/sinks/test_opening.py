"""Sinks by name."""

import json
import socket
from collections.abc import Callable
from pathlib import Path

import pytest
from msgspec.structs import replace

from thenar.drivers.errors import SettingError
from thenar.runtime.published import Health, HealthReport, LiveGrasp, Preshape
from thenar.runtime.sinks import Fanout, JsonLines, open_sink
from thenar.runtime.sinks.base import PublishPace
from thenar.runtime.sinks.sockets import SocketLines


def test_every_kind_is_opened_by_its_name(tmp_path: Path) -> None:
    for where, kind in (
        ("jsonl:-", JsonLines),
        (f"jsonl:{tmp_path}/lines", JsonLines),
        ("tcp:127.0.0.1:0", SocketLines),
        ("tcp:127.0.0.1:0?public", SocketLines),
    ):
        sink = open_sink(where)
        assert isinstance(sink, kind)
        assert sink.report().where == where
        sink.close()


@pytest.mark.parametrize(
    "where", ["", "jsonl", "jsonl:", "amqp:broker", "ros", "ros:thenar", "ros:/a//b", "ros:/2nd", "ros:?public"]
)
def test_a_name_that_means_nothing_is_told_how_to_write_it(where: str) -> None:
    with pytest.raises(SettingError, match=r"jsonl:FILE|ros:/thenar"):
        open_sink(where)


@pytest.mark.parametrize("options", ["open", "public&open", "rate=5&every", "on=change&rate=5", "rate", ""])
def test_unknown_options_and_two_paces_are_refused(options: str) -> None:
    with pytest.raises(SettingError, match=r"after the question mark only \?public and one of \?every, \?rate=HZ or"):
        open_sink(f"ros:/a?{options}")


@pytest.mark.parametrize("rate", ["", "0", "1001", "fast", "1.5", "-1", "9" * 30])
def test_a_rate_that_cannot_be_is_refused(rate: str) -> None:
    with pytest.raises(SettingError, match="1 to 1000 a second"):
        open_sink(f"jsonl:-?rate={rate}")


@pytest.mark.parametrize(
    ("options", "wait", "rate"),
    [("", False, 10), ("?rate=50", False, 50), ("?on=change", False, 0), ("?every", False, 2000), ("", True, 2000)],
)
def test_lines_come_on_change_and_at_the_rate(
    make_grasp: Callable[..., LiveGrasp], tmp_path: Path, options: str, wait: bool, rate: int
) -> None:
    fanout = Fanout([open_sink(f"jsonl:{tmp_path}/lines{options}", wait=wait)])
    for number in range(2000):
        health: Health = "changing" if number % 3 else "ok"
        grasp = replace(make_grasp(number), time_us=500 * number, health=health)
        fanout.publish(replace(grasp, state="held") if 507 <= number < 509 else grasp, None, None)
    fanout.close()
    numbers = [json.loads(line)["number"] for line in (tmp_path / "lines").read_bytes().splitlines()]
    due = range(0, 2000, 2000 // rate) if rate else (0,)
    assert numbers == sorted({*due, 507, 509})


def test_a_new_preshape_is_a_change(make_grasp: Callable[..., LiveGrasp], preshape: Preshape, tmp_path: Path) -> None:
    fanout, other = Fanout([open_sink(f"jsonl:{tmp_path}/lines?on=change")]), replace(preshape, name="other")
    for number, shape in enumerate([None, preshape, preshape, other]):
        fanout.publish(make_grasp(number), shape, None)
    fanout.close()
    numbers = [json.loads(line)["number"] for line in (tmp_path / "lines").read_bytes().splitlines()]
    assert numbers == [0, 1, 3]


def test_who_connects_while_nothing_changes_gets_the_next_report(health: HealthReport) -> None:
    sink = open_sink("tcp:0?on=change")
    assert isinstance(sink, SocketLines)
    fanout = Fanout([sink])
    with socket.create_connection(sink.address) as reader:
        fanout.health(health)
        fanout.close()
        assert json.loads(reader.recv(10_000))["kind"] == "health"


def test_a_clock_that_begins_again_is_a_moment_to_publish() -> None:
    pace, times_us = PublishPace(1), (5, 6, 0, 1, 999_999, 1_000_000)
    due = [time_us for time_us in times_us if pace.due(time_us, ("power",))]
    assert due == [5, 0, 1_000_000]
