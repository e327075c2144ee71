"""Whatever happens outside of `thenar run`, it goes on, says so, publishes nothing old, and can be ended."""

import fcntl
import json
import os
import pty
import resource
import select
import signal
import subprocess
import sys
import termios
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from threading import Condition, Event, Thread
from time import monotonic
from typing import Any

import numpy as np
import pytest

from thenar.compiler import GraspSet, compile_build
from thenar.runtime.frames import now_us
from thenar.runtime.published import LiveGrasp
from thenar.runtime.recording.reader import Reader

pytestmark = pytest.mark.slow

PATIENCE_S = 60.0
# What has waited for longer is not published.
LATE_US = 500_000
# As long as there is a file "frozen" in the folder DISK, all writes to files of it wait.
DISK = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
static void wait_while_frozen(int file) {
    const char *disk = getenv("DISK");
    char link[64], path[4096], flag[4200];
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (disk == NULL || length < 0 || strncmp(path, disk, strlen(disk)) != 0) return;
    snprintf(flag, sizeof flag, "%s/frozen", disk);
    while (access(flag, F_OK) == 0) usleep(1000);
}
ssize_t write(int file, const void *data, size_t size) {
    ssize_t (*real)(int, const void *, size_t);
    *(void **)&real = dlsym(RTLD_NEXT, "write");
    wait_while_frozen(file);
    return real(file, data, size);
}
int fdatasync(int file) {
    int (*real)(int);
    *(void **)&real = dlsym(RTLD_NEXT, "fdatasync");
    wait_while_frozen(file);
    return real(file);
}
"""
GLOVE = """name = "maker"
[[stream]]
port = "-"
columns = ["ms", "s0", "s1", "s2", "s3", "s4", "s5"]
time = "ms"
rate_hz = {rate}
switches = ["s0", "s1", "s2", "s3", "s4", "s5"]
"""


@pytest.fixture(scope="module")
def build(small_set: GraspSet, tmp_path_factory: pytest.TempPathFactory) -> Path:
    bare = replace(small_set, codes=np.zeros((len(small_set), 0), np.uint16), joints=())
    return compile_build(bare, tmp_path_factory.mktemp("outside") / "build", rounds=10, folds=0).folder


@pytest.fixture(scope="module")
def disk_library(c_compiler: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("disk")
    (folder / "disk.c").write_text(DISK)
    subprocess.run([c_compiler, "-shared", "-fPIC", "-o", folder / "disk.so", folder / "disk.c", "-ldl"], check=True)
    return folder / "disk.so"


class Running:
    """A run whose glove sends a row every 10 ms, and the lines that it publishes on stdout."""

    def __init__(self, build: Path, folder: Path, library: Path, *options: object, rate: float = 100, **streams: Any):
        self.disk, self.errors = folder / "disk", folder / "errors"
        self.disk.mkdir()
        (folder / "glove.toml").write_text(GLOVE.format(rate=rate))
        command = [sys.executable, "-m", "thenar.cli", "run", build, "--glove", folder / "glove.toml", "--status"]
        with self.errors.open("wb") as errors:
            self.process = subprocess.Popen(
                [*map(str, command), *map(str, options)],
                stdin=subprocess.PIPE,
                env={**os.environ, "LD_PRELOAD": str(library), "DISK": str(self.disk)},
                **{"stdout": subprocess.PIPE, "stderr": errors, **streams},
            )
        self.lines: list[dict[str, Any]] = []
        self._came, self._done = Condition(), Event()
        work = [self._send, *([] if self.process.stdout is None else [self._read])]
        self._threads = [Thread(target=each) for each in work]
        for thread in self._threads:
            thread.start()

    def _send(self) -> None:
        assert self.process.stdin is not None
        number = 0
        while not self._done.wait(0.01):
            number += 1
            try:
                self.process.stdin.write(b"%d,0,0,1,1,0,1\n" % (10 * number))
                self.process.stdin.flush()
            except OSError:
                return

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            with self._came:
                self.lines.append(json.loads(line))
                self._came.notify_all()

    def line(self, wanted: Callable[[dict[str, Any]], object]) -> dict[str, Any]:
        """Wait for a line, from now on."""
        seen, end = len(self.lines), monotonic() + PATIENCE_S
        with self._came:
            while not (found := [line for line in self.lines[seen:] if wanted(line)]):
                assert self._came.wait(end - monotonic()), (self.lines[-3:], self.said)
        return found[0]

    def goes_on(self) -> None:
        """Wait until it has recognised for two more seconds, and all was well in the end."""
        after_us = now_us() + 2_000_000
        self.line(lambda line: line["kind"] == "grasp" and line["health"] == "ok" and line["time_us"] > after_us)

    def until(self, condition: Callable[[], object]) -> None:
        end, never = monotonic() + PATIENCE_S, Event()
        while not condition():
            assert monotonic() < end, self.said
            never.wait(0.01)

    @property
    def said(self) -> str:
        return self.errors.read_text()

    def freeze(self) -> int:
        """Let the disk take nothing, and return since when."""
        (self.disk / "frozen").touch()
        return now_us()

    def thaw(self) -> int:
        (self.disk / "frozen").unlink()
        return now_us()

    def end(self, number: signal.Signals = signal.SIGTERM) -> int:
        self.process.send_signal(number)
        return self.process.wait(PATIENCE_S)

    def close(self) -> None:
        self._done.set()
        self.process.kill()
        self.process.wait()
        for thread in self._threads:
            thread.join()
        assert self.process.stdin is not None
        with suppress(BrokenPipeError):
            self.process.stdin.close()
        if self.process.stdout is not None:
            self.process.stdout.close()


Start = Callable[..., Running]


@pytest.fixture
def start(build: Path, disk_library: Path, tmp_path: Path) -> Iterator[Start]:
    made: list[Running] = []

    def running(*options: object, **more: Any) -> Running:
        made.append(Running(build, tmp_path, disk_library, *options, **more))
        return made[-1]

    yield running
    for each in made:
        each.close()


def grasps_of(path: Path) -> list[LiveGrasp]:
    return [entry for entry in Reader(path) if isinstance(entry, LiveGrasp)]


def test_a_frozen_recording_is_reported_delays_nothing_and_stays_whole(start: Start, tmp_path: Path) -> None:
    path = tmp_path / "disk" / "run.mcap"
    run = start("--sink", "jsonl:-?every", "--record", path)
    run.goes_on()
    run.freeze()
    said = run.line(lambda line: line["kind"] == "health" and line["outputs"])
    assert [output["name"] for output in said["outputs"]] == ["recording"]
    assert "the disk does not respond" in said["outputs"][0]["what"]
    run.goes_on()
    run.thaw()
    run.line(lambda line: line["kind"] == "health" and not line["outputs"])
    assert run.end() == 0
    assert "recording: works again" in run.said
    published = [line["number"] for line in run.lines if line["kind"] == "grasp"]
    assert published == list(range(len(published)))
    assert [grasp.number for grasp in grasps_of(path)] == published
    assert f"{path}: " in run.said
    assert "lost" not in run.said


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_a_run_whose_disk_is_frozen(start: Start, tmp_path: Path, number: signal.Signals) -> None:
    path = tmp_path / "disk" / "run.mcap"
    run = start("--sink", "jsonl:-?every", "--sink", f"jsonl:{tmp_path}/disk/lines?every", "--record", path)
    run.goes_on()
    run.freeze()
    run.goes_on()
    assert run.end(number) == 1
    assert "moments lost; " in run.said
    assert f"jsonl:{tmp_path}/disk/lines?every: " in run.said


def test_a_frozen_disk_delays_no_other_sink(start: Start, tmp_path: Path) -> None:
    path = tmp_path / "disk" / "lines"
    run = start("--sink", f"jsonl:{path}?every", "--sink", "jsonl:-?every")
    run.goes_on()
    frozen_us = run.freeze()
    said = run.line(lambda line: line["kind"] == "health" and line["outputs"])
    assert said["outputs"] == [
        {"name": f"jsonl:{path}?every", "what": "does not respond: what comes meanwhile is lost"}
    ]
    run.goes_on()
    thawed_us = run.thaw()
    run.goes_on()
    assert run.end() == 0
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    times = [line["time_us"] for line in lines]
    assert max(times) > thawed_us
    # The line that was being written when the disk froze is the only old one.
    assert sum(frozen_us < time_us < thawed_us - LATE_US for time_us in times) <= 1
    lost = len(run.lines) - len(lines)
    assert lost > 0
    assert f"jsonl:{path}?every: {len(lines)} frames sent, {lost} lost" in run.said


@pytest.fixture
def full_pipe() -> Iterator[int]:
    """Yield the end of a pipe that is full and has no reader."""
    ours, theirs = os.pipe()
    fcntl.fcntl(theirs, fcntl.F_SETPIPE_SZ, 4096)
    os.write(theirs, bytes(4096))
    assert not select.select([], [theirs], [], 0)[1]
    yield theirs
    os.close(ours)
    os.close(theirs)


def test_notices_that_nobody_reads_stop_nothing(start: Start, full_pipe: int) -> None:
    run = start("--sink", "jsonl:-?every", stderr=full_pipe)
    run.goes_on()
    assert run.end() == 0


def test_a_stdout_that_nobody_reads_stops_nothing(start: Start, tmp_path: Path, full_pipe: int) -> None:
    path = tmp_path / "run.mcap"
    run = start("--record", path, stdout=full_pipe)
    run.until(lambda: path.exists() and len(grasps_of(path)) > 100)
    assert run.end() == 0
    assert "lost" in run.said


def test_a_terminal_that_is_held_stops_nothing(start: Start, tmp_path: Path) -> None:
    ours, theirs = pty.openpty()
    try:
        termios.tcflow(theirs, termios.TCOOFF)
        path = tmp_path / "run.mcap"
        run = start("--record", path, stdout=theirs)
        run.until(lambda: path.exists() and len(grasps_of(path)) > 200)
        assert run.end() == 0
    finally:
        os.close(ours)
        os.close(theirs)


def test_on_a_full_disk_files_go_on_once_there_is_room(start: Start, tmp_path: Path) -> None:
    path, lines = tmp_path / "run.mcap", tmp_path / "lines"
    run = start("--sink", "jsonl:-?every", "--sink", f"jsonl:{lines}?every", "--record", path)
    run.goes_on()
    limits = resource.prlimit(run.process.pid, resource.RLIMIT_FSIZE)
    resource.prlimit(run.process.pid, resource.RLIMIT_FSIZE, (lines.stat().st_size + 5000, limits[1]))
    said = run.line(lambda line: line["kind"] == "health" and line["outputs"])
    assert "File too large" in said["outputs"][0]["what"]
    run.goes_on()
    resource.prlimit(run.process.pid, resource.RLIMIT_FSIZE, limits)
    run.line(lambda line: line["kind"] == "health" and not line["outputs"])
    room_us = now_us()
    run.goes_on()
    assert run.end() == 1  # something was lost
    reader = Reader(path)
    recorded = [entry for entry in reader if isinstance(entry, LiveGrasp)]
    assert (reader.end is not None and reader.end.closed, reader.altered) == (True, False)
    published = {line["number"] for line in run.lines if line["kind"] == "grasp"}
    assert {grasp.number for grasp in recorded} < published
    assert recorded[-1].time_us > room_us
    kept = [json.loads(line) for line in lines.read_text().splitlines()]
    assert kept[-1]["time_us"] > room_us
    assert len(kept) < len(run.lines)
    assert "recording: works again" in run.said
    assert "messages lost" in run.said
    sent, lost = len(kept), len(run.lines) - len(kept)
    assert f"jsonl:{lines}?every: {sent} frames sent, {lost} lost: File too large" in run.said


def test_a_signal_ends_a_run_whose_device_is_slow_and_silent(start: Start) -> None:
    run = start("--sink", "jsonl:-?every", rate=0.1)
    run.line(lambda line: line["kind"] == "grasp" and line["health"] == "ok")
    run._done.set()
    run.line(lambda line: line["kind"] == "grasp" and line["switch_age_us"] > 1_000_000)
    assert run.end() == 0
