"""What devices send and are sent: the records of a CyberGlove, its answers, the lines of a board.

A frame must not depend on how its bytes were cut, and no parser may stay out of step.
"""

from pathlib import Path
from random import Random

from material import Format
from mutating import altered

from thenar.drivers import cyberglove_protocol
from thenar.drivers.emulated.cyberglove import CyberGloveBox
from thenar.drivers.lines import LONGEST, LineParser, checked

_RECORD = cyberglove_protocol.Record(b"S" * 18)
_COMMANDS = [
    *map(cyberglove_protocol.query, cyberglove_protocol.REPLY_BYTES),
    *(cyberglove_protocol.setting(letter, bytes(size)) for letter, size in cyberglove_protocol.SET.items()),
    cyberglove_protocol.INFORMATION,
]
_ANSWERS = b"?G\3\0?S\x12\0?T\x04\x80\0\1\0?iCyberGlove\r\n\0e?\0"


def _glove_says() -> list[bytes]:
    record = cyberglove_protocol.Record(bytes(range(60, 78)))
    # The first byte chooses to which command an answer is sought.
    answers = [bytes([place]) + _ANSWERS for place in range(0, 40, 3)]
    return [cyberglove_protocol.encode(record) * 3, *answers]


def _glove(data: bytes, _folder: Path) -> None:
    _records(data)
    _answer(data)
    box = CyberGloveBox()
    box.feed(data)
    assert len(box._pending) < 600


def _records(data: bytes) -> None:
    """Read a CyberGlove's records, at once and in two parts, and a sound one after."""
    for sensors, status in ((18, False), (22, True)):
        whole, parts = (cyberglove_protocol.RecordDecoder(sensors, status=status) for _ in range(2))
        half = len(data) // 2
        assert whole.feed(data) == parts.feed(data[:half]) + parts.feed(data[half:])
        assert len(whole._rest) < 30
    decoder = cyberglove_protocol.RecordDecoder()
    decoder.feed(data + b"\0")
    assert decoder.feed(cyberglove_protocol.encode(_RECORD)) == [_RECORD]


def _answer(data: bytes) -> None:
    """Look for the answer to a command, which the first byte chooses."""
    command = _COMMANDS[data[0] % len(_COMMANDS)] if data else _COMMANDS[0]
    for last in (False, True):
        answer = cyberglove_protocol.find_reply(command, data[1:], last=last)
        assert answer is None or answer.error or answer.values in data


_COLUMNS, _ROW = checked(("columns", "a", "b", "c", "d", "e", "f")), checked(("row", "9", "7000", "1F", "512"))


def _board_says() -> list[bytes]:
    rows = [
        checked(("row", *fields)) for fields in (("65535", "4294967295", "0A", ""), ("0", "0", "3", "1", "-2", "3"))
    ]
    return [_COLUMNS + _ROW * 3, *rows, _COLUMNS + b"".join(rows), b"ms,a\n1,2\n" + _COLUMNS + b"boot\n" + _ROW]


def _changed_lines(data: bytes, random: Random) -> bytes:
    """Change what a line says, with the checksum of what it says then; or the bytes on the line."""
    lines = data.splitlines()
    if not lines or random.random() < 0.3:
        return altered(data, random)
    at = random.randrange(len(lines))
    body = altered(lines[at].strip(b"$")[:-3], random).decode("utf-8", "replace")
    lines[at] = checked(body.split(","))
    if random.random() < 0.2:
        lines.insert(random.randrange(len(lines)), random.choice(lines))
    return b"\n".join(lines) + b"\n"


def _board(data: bytes, _folder: Path) -> None:
    """Read lines, at once and in two parts, and a sound one after."""
    whole, parts = LineParser(5), LineParser(5)
    half = len(data) // 2
    assert whole.feed(data) == parts.feed(data[:half]) + parts.feed(data[half:])
    assert whole.counts == parts.counts
    assert len(whole._rest) <= LONGEST
    (row,) = whole.feed(b"\n" + _COLUMNS + _ROW)[-1:]
    assert (row.sequence, row.values) == (9, (1, 1, 1, 1, 1, 512))


FORMATS = (
    Format("cyberglove", _glove_says, altered, _glove),
    Format("lines", _board_says, _changed_lines, _board),
)
