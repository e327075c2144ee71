"""Sinks by name."""

from pathlib import Path

import pytest

from thenar.drivers.errors import SettingError
from thenar.runtime.sinks import JsonLines, SocketLines, open_sink


def test_every_kind_is_opened_by_its_name(tmp_path: Path) -> None:
    for where, kind in (
        ("jsonl:-", JsonLines),
        (f"jsonl:{tmp_path}/lines", JsonLines),
        (f"unix:{tmp_path}/socket", SocketLines),
        ("tcp:127.0.0.1:0", SocketLines),
        ("tcp-public:127.0.0.1:0", SocketLines),
    ):
        sink = open_sink(where)
        assert isinstance(sink, kind)
        assert sink.report().where == where
        sink.close()


@pytest.mark.parametrize(
    "where", ["", "jsonl", "jsonl:", "mqtt:broker", "ros", "ros:thenar", "ros:/a//b", "ros:/2nd", "ros:?public"]
)
def test_a_name_that_means_nothing_is_told_how_to_write_it(where: str) -> None:
    with pytest.raises(SettingError, match=r"unix:PATH|ros:/thenar"):
        open_sink(where)


def test_behind_the_name_of_ros_topics_only_public_means_something() -> None:
    with pytest.raises(SettingError, match=r"'ros:/a\?open': after the question mark only `public` or `rate=HZ` can"):
        open_sink("ros:/a?open")
