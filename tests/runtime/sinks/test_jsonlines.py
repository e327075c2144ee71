"""JSON lines into files and pipes."""

import io
import os
import resource
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest
from msgspec import json

from thenar.runtime.published import LiveGrasp
from thenar.runtime.sinks import Fanout, GraspLine, JsonLines, SinkError, open_sink

MakeGrasp = Callable[..., LiveGrasp]


def numbers(data: bytes) -> list[int]:
    return [json.decode(line, type=GraspLine).number for line in data.splitlines()]


def test_a_file_on_disk_grows_and_keeps_what_it_has(make_grasp: MakeGrasp, tmp_path: Path) -> None:
    path = tmp_path / "run.jsonl"
    for number in (1, 2):
        sink = open_sink(f"jsonl:{path}")
        sink.publish(make_grasp(number), None, None)
        sink.close()
        sink.close()
    assert numbers(path.read_bytes()) == [1, 2]


def test_behind_a_torn_line_the_first_frame_begins_a_line(make_grasp: MakeGrasp, tmp_path: Path) -> None:
    path = tmp_path / "run.jsonl"
    sink = open_sink(f"jsonl:{path}")
    sink.publish(make_grasp(1), None, None)
    sink.close()
    whole = path.read_bytes()
    for cut in range(1, len(whole)):
        path.write_bytes(whole + whole[:cut])
        sink = open_sink(f"jsonl:{path}")
        sink.publish(make_grasp(2), None, None)
        sink.close()
        first, torn, *rest = path.read_bytes().splitlines(keepends=True)
        assert (first, torn) == (whole, whole[:cut] + b"\n")
        assert numbers(b"".join(rest)) == [2]


@pytest.mark.parametrize("room", range(0, 400, 7))
def test_a_full_disk_leaves_whole_lines_alone(make_grasp: MakeGrasp, tmp_path: Path, room: int) -> None:
    path = tmp_path / "run.jsonl"
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    sink = open_sink(f"jsonl:{path}")
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000 + room, before[1]))
    try:
        for number in range(20):
            sink.publish(make_grasp(number), None, None)
        report = sink.report()
        full = path.read_bytes()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert (report.error, report.gone) == ("File too large", False)
    assert numbers(full) == list(range(report.sent))
    # There is room again.
    sink.publish(make_grasp(20), None, None)
    sink.close()
    assert numbers(path.read_bytes()) == [*range(report.sent), 20]
    assert (sink.report().sent, sink.report().lost) == (report.sent + 1, report.lost)


def drain(pipe: int, into: bytearray) -> None:
    while piece := os.read(pipe, 4096):
        into.extend(piece)


def test_a_slow_pipe_loses_whole_lines_and_holds_nobody_up(make_grasp: MakeGrasp) -> None:
    (ours, theirs), read = os.pipe(), bytearray()
    reader = threading.Thread(target=drain, args=(ours, read))
    with os.fdopen(theirs, "wb") as file:
        fanout = Fanout([JsonLines(file)], live=True)
        for number in range(5000):
            fanout.publish(make_grasp(number, lost=("s001",) * 20), None, None)
        reader.start()
        fanout.close()
    reader.join(timeout=30)
    os.close(ours)
    [report] = fanout.reports()
    assert report.lost > 0
    assert report.sent + report.lost == 5000
    found = numbers(bytes(read))
    assert found == sorted(set(found))
    assert len(found) == report.sent


def test_a_replay_waits_for_its_reader_and_loses_nothing(make_grasp: MakeGrasp) -> None:
    (ours, theirs), read = os.pipe(), bytearray()
    reader = threading.Thread(target=drain, args=(ours, read))
    reader.start()
    with os.fdopen(theirs, "wb") as file:
        sink = JsonLines(file)
        for number in range(3000):
            sink.publish(make_grasp(number), None, None)
        sink.close()
    reader.join(timeout=30)
    os.close(ours)
    assert numbers(bytes(read)) == list(range(3000))


def test_a_reader_that_is_gone_is_told_in_the_report(make_grasp: MakeGrasp) -> None:
    ours, theirs = os.pipe()
    os.close(ours)
    with os.fdopen(theirs, "wb") as file:
        sink = JsonLines(file)
        for number in range(3):
            sink.publish(make_grasp(number), None, None)
        report = sink.report()
        sink.close()
    assert (report.sent, report.lost, report.error, report.gone) == (0, 3, "Broken pipe", True)


def test_a_file_that_somebody_closed_raises_nothing(make_grasp: MakeGrasp) -> None:
    file = io.BytesIO()
    sink = JsonLines(file)
    file.close()
    sink.publish(make_grasp(), None, None)
    assert sink.report().lost == 1


def test_a_file_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SinkError, match="No such file or directory"):
        open_sink(f"jsonl:{tmp_path}/nowhere/run.jsonl")
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(SinkError, match="is its reader running"):
        open_sink(f"jsonl:{tmp_path}/pipe")


def test_stdout_gets_the_lines_and_stays_open() -> None:
    code = (
        "from thenar.runtime.sinks import open_sink\n"
        "from thenar.runtime.published import LiveGrasp\n"
        "sink = open_sink('jsonl:-')\n"
        "sink.publish(LiveGrasp(1, 2, 3, 'PoS', 'PoS', 0.5, 4, 'ok', None, None, 5), None, None)\n"
        "sink.close()\n"
        "print('and more')\n"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)
    first, second = done.stdout.splitlines()
    assert json.decode(first, type=GraspLine).number == 3
    assert second == b"and more"
