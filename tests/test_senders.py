"""The senders of examples/senders print rows that a [[stream]] reads, each on what it is written for."""

import os
import pty
import select
import subprocess
import sys
import tty
from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from time import monotonic

import pytest

from thenar.drivers.lines import LineParser, Row
from thenar.runtime.live.stream_probe import propose_glove

from .conftest import tool

SENDERS = Path(__file__).resolve().parents[1] / "examples" / "senders"
COLUMNS = ("ms", "thumb", "index", "flex_index", "pad_palm")
LONG_S = 60.0
# Of the pins and converters of a board, which MicroPython's Unix port has not.
MACHINE = """
class Pin:
    IN, PULL_UP = 0, 1
    def __init__(self, number, mode=None, pull=None):
        self.number = number
    def value(self):
        return int(self.number == 14)
class ADC:
    def __init__(self, pin):
        self.pin = pin
    def read_u16(self):
        return 1000 * self.pin.number
"""


@pytest.fixture
def started() -> Iterator[Callable[..., subprocess.Popen[bytes]]]:
    """Return what starts a program that ends with the test."""
    running: list[subprocess.Popen[bytes]] = []

    def start(command: Sequence[object], **options: object) -> subprocess.Popen[bytes]:
        running.append(subprocess.Popen([str(word) for word in command], **options))  # type: ignore[call-overload]
        return running[-1]

    yield start
    for process in running:
        process.kill()
        process.communicate()


def rows(descriptor: int, number: int) -> list[Row]:
    """Return so many rows of what comes out of a descriptor, all of which must be rows of the columns."""
    parser, found, end = LineParser(), list[Row](), monotonic() + LONG_S
    while len(found) < number:
        assert monotonic() < end
        if select.select([descriptor], [], [], 0.1)[0]:
            found += parser.feed(os.read(descriptor, 4096).replace(b"\x1b[32m", b"").replace(b"\x1b[0m", b""))
    assert all(row.names == COLUMNS for row in found)
    return found


def check_pace(found: Sequence[Row]) -> None:
    """Check that rows were made at most 50 times a second by the sender's clock, but for those that it catches up."""
    times = [row.values[0] or 0.0 for row in found]
    assert all(time - times[0] >= 20 * place - 20 for place, time in enumerate(times))


@pytest.mark.parametrize("name", ["glove_lines/glove_lines.ino", "micropython_lines.py", "python_lines.py"])
def test_a_sender_has_some_twenty_lines_and_says_what_to_do_next(name: str) -> None:
    text = (SENDERS / name).read_text()
    assert len(text.splitlines()) <= 22
    assert "thenar doctor --line" in text


@pytest.mark.slow
def test_the_python_sender_over_a_pty_is_proposed_as_what_it_is(started: Callable[..., object]) -> None:
    (near, far), (heard, port) = pty.openpty(), pty.openpty()
    for end in (far, port):
        tty.setraw(end)
    started([sys.executable, SENDERS / "python_lines.py", os.ttyname(far)])
    check_pace(rows(near, 20))
    cable = started(
        [sys.executable, "-c", f"import os\nwhile True: os.write({heard}, os.read({near}, 999))"],
        pass_fds=(near, heard),
    )
    found = propose_glove(os.ttyname(port), 115_200, 3.5).harness.streams[0]
    assert cable is not None
    assert (found.time, found.time_unit) == ("c1", "ms")
    assert found.switches == ("c2", "c3")
    assert 0 < found.rate_hz <= 55
    for descriptor in (near, far, heard, port):
        os.close(descriptor)


@pytest.mark.slow
def test_the_micropython_sender_runs_in_the_unix_port(started: Callable[..., object], tmp_path: Path) -> None:
    if find_spec("micropython_unix") is None:
        tool("micropython_unix of PyPI")
    (tmp_path / "machine.py").write_text(MACHINE)
    command = [sys.executable, "-m", "micropython_unix", SENDERS / "micropython_lines.py"]
    process = started(command, cwd=tmp_path, stdout=subprocess.PIPE, env=os.environ | {"MICROPYPATH": str(tmp_path)})
    assert isinstance(process, subprocess.Popen)
    assert process.stdout is not None
    found = rows(process.stdout.fileno(), 20)
    check_pace(found)
    assert {row.values[1:] for row in found} == {(0, 1, 26_000, 27_000)}


@pytest.mark.slow
def test_the_arduino_sender_runs_on_an_uno_in_simavr(
    started: Callable[..., object], arduino: Callable[..., Path]
) -> None:
    elf = arduino(SENDERS / "glove_lines" / "glove_lines.ino", "glove_lines")
    command = [tool("simavr"), "-m", "atmega328p", "-f", "16000000", str(elf)]
    process = started(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    assert isinstance(process, subprocess.Popen)
    assert process.stdout is not None
    found = simulated(process.stdout.fileno(), 20)
    assert len(found) >= 20
    assert all(later.values[0] - earlier.values[0] == 20 for earlier, later in pairwise(found))  # type: ignore[operator]
    assert {row.values[1:3] for row in found} == {(0, 0)}
    assert all(0 <= number <= 1023 for row in found for number in row.values[3:] if number is not None)


def simulated(descriptor: int, number: int) -> list[Row]:
    """Return rows that a program prints at its UART: simavr repeats lines in colours, with dots for their ends."""
    text, end = b"", monotonic() + LONG_S
    while text.count(b"\n") < number + 8:
        assert monotonic() < end, text
        if select.select([descriptor], [], [], 0.1)[0]:
            text += os.read(descriptor, 4096)
    parser = LineParser()
    lines = text.replace(b"\x1b[32m", b"").replace(b"\x1b[0m", b"").replace(b"..", b"").split(b"\n")
    return [row for row in parser.feed(b"\n".join(lines)) if row.names == COLUMNS]
