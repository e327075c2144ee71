from collections.abc import Iterator
from pathlib import Path
from time import monotonic

import pytest

from thenar.drivers.cyberglove import Dialogue
from thenar.drivers.cyberglove_protocol import (
    Record,
    RecordDecoder,
    RecordFault,
    setting,
    shortest_us,
)
from thenar.drivers.emulated.cyberglove import EmulatedCyberGlove
from thenar.drivers.emulated.serial_line import PtyLine
from thenar.drivers.serial_line import SerialLine

SOON_S = 10.0


@pytest.fixture
def line(tmp_path: Path) -> Iterator[PtyLine]:
    with PtyLine(tmp_path / "glove") as line:
        yield line


@pytest.fixture
def client(line: PtyLine) -> Iterator[SerialLine]:
    with SerialLine(str(line.link), 115_200) as client:
        yield client


def records(client: SerialLine, count: int, decoder: RecordDecoder | None = None) -> list[Record]:
    """Return as many records as asked for, fewer if they take too long."""
    decoder, found, end = decoder or RecordDecoder(), list[Record](), monotonic() + SOON_S
    while len(found) < count and (left := end - monotonic()) > 0:
        found += decoder.feed(client.read(left))
    return found


def test_it_streams_no_faster_than_box_and_line_allow(line: PtyLine, client: SerialLine) -> None:
    with EmulatedCyberGlove(line):
        began = monotonic()
        client.write(b"S")
        found = records(client, 50)
        # Half a byte's time of grace is the line's.
        assert monotonic() - began >= 50 * shortest_us(18, 115_200) / 1e6 - 1e-4
    assert {record.fault for record in found} == {None}


def test_what_is_done_to_the_glove_shows_in_its_records(line: PtyLine, client: SerialLine) -> None:
    decoder = RecordDecoder(22, status=True)
    with EmulatedCyberGlove(line, sensors=22) as glove:
        Dialogue(client).ask(setting("U", b"\1"))
        Dialogue(client).ask(setting("T", b"\xff\xff\0\1"))  # half a second, long enough for one record at a time
        for number in range(5):
            values = bytes([100 + number] * 22)
            glove.set(values)
            glove.box.plugged = number != 3
            client.write(b"S")
            fault: RecordFault | None = "unplugged" if number == 3 else None
            status = 0x80 | (number != 3)
            assert records(client, 1, decoder) == [Record(values, fault=fault, status=status)]
            Dialogue(client).stop_stream()
        assert glove.records == 5


def test_closed_it_sends_nothing_and_the_line_stays(line: PtyLine, client: SerialLine) -> None:
    with EmulatedCyberGlove(line) as glove:
        client.write(b"S")
        assert records(client, 1)
        assert glove.box.streaming
    client.drain(0.05)
    assert client.read(0.05) == b""
    line.send(b"still there")
    assert client.read(SOON_S)
