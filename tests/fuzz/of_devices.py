"""What devices send and are sent: the records of a CyberGlove, its answers, the frames of a scanner board.

A frame must not depend on how its bytes were cut, and no parser may stay out of step.
"""

import contextlib
from pathlib import Path
from random import Random

from material import Format
from mutating import altered

from thenar.drivers import cyberglove_protocol, scanner_protocol
from thenar.drivers.emulated.cyberglove_box import CyberGloveBox, Doubts, GloveState
from thenar.drivers.emulated.scanner import ScannerBoard
from thenar.drivers.errors import ThenarError
from thenar.drivers.scanner_protocol import (
    PROTOCOL,
    Analog,
    Channels,
    Event,
    FromBoard,
    GetState,
    Heartbeat,
    Hello,
    Ping,
    SetChannels,
    State,
    ToBoard,
)
from thenar.drivers.scanner_state import BoardKeys, BoardTimes

_KEYS = 40
_RECORD = cyberglove_protocol.Record(b"S" * 18)
_STATE = scanner_protocol.Frame(scanner_protocol.STATE, 0, bytes(5))
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
    box = CyberGloveBox(GloveState(18, 0), "CyberGlove", Doubts())
    box.feed(data)
    assert len(box._pending) < 600


def _records(data: bytes) -> None:
    """Read a CyberGlove's records, at once and in two parts, and a sound one after."""
    for sensors, status in ((18, False), (22, True)):
        whole, parts = (cyberglove_protocol.RecordDecoder(sensors, status=status) for _ in range(2))
        half = len(data) // 2
        assert whole.feed(data) == parts.feed(data[:half]) + parts.feed(data[half:])
        assert len(whole._pieces._rest) < 30
    decoder = cyberglove_protocol.RecordDecoder()
    decoder.feed(data + b"\0")
    assert decoder.feed(cyberglove_protocol.encode(_RECORD)) == [_RECORD]


def _answer(data: bytes) -> None:
    """Look for the answer to a command, which the first byte chooses."""
    command = _COMMANDS[data[0] % len(_COMMANDS)] if data else _COMMANDS[0]
    for last in (False, True):
        answer = cyberglove_protocol.find_reply(command, data[1:], last=last)
        assert answer is None or answer.error or answer.values in data


def _board_says() -> list[bytes]:
    hello = Hello(PROTOCOL, 0, 1, 1, 1, 0, 0, 1, _KEYS, 1000, 0, 50_000, 0, 0, 0)
    messages: list[FromBoard | ToBoard] = [hello, State(5, _KEYS), Heartbeat(7, 5, _KEYS), Event(9, 3, 1)]
    messages += [Ping(1), GetState(), SetChannels(1, 5000, 5, 8), Channels(2, 1, 10, 5000, 5, 8), Analog(9, 1, (3, 7))]
    frames = [scanner_protocol.frame(message, number) for number, message in enumerate(messages)]
    return [scanner_protocol.encode(frame) for frame in frames] + [b"".join(map(scanner_protocol.encode, frames))]


def _changed_frames(data: bytes, random: Random) -> bytes:
    """Change what frames say, with the CRC of what they say then; or the bytes on the line."""
    frames = scanner_protocol.FrameDecoder().feed(data)
    if not frames or random.random() < 0.3:
        return altered(data, random)
    at = random.randrange(len(frames))
    body = altered(bytes((frames[at].kind, frames[at].sequence)) + frames[at].payload, random)[:252]
    frames[at] = scanner_protocol.Frame(body[0], body[1], body[2:]) if len(body) > 1 else _STATE
    if random.random() < 0.2:
        frames.insert(random.randrange(len(frames)), random.choice(frames))
    return b"".join(map(scanner_protocol.encode, frames))


def _board(data: bytes, _folder: Path) -> None:
    """Read a scanner board's frames, at once and in two parts, and a sound one after; as the host and as the board."""
    whole, parts = scanner_protocol.FrameDecoder(), scanner_protocol.FrameDecoder()
    half = len(data) // 2
    found = whole.feed(data)
    assert found == parts.feed(data[:half]) + parts.feed(data[half:])
    assert len(whole._pieces._rest) < 260
    whole.feed(b"\0")
    assert whole.feed(scanner_protocol.encode(_STATE)) == [_STATE]
    for keys in (BoardKeys(1, _KEYS), BoardKeys()):
        _heard(found, keys)
    for channels in (0, 8):
        board = ScannerBoard(1, _KEYS, channels=channels)
        answers = [*board.receive(data, 0), *board.scan(0, 1 << 32)]
        for answer in scanner_protocol.FrameDecoder().feed(b"".join(answers)):
            scanner_protocol.from_board(answer, _KEYS)


def _heard(received: list[scanner_protocol.Frame], keys: BoardKeys) -> None:
    """Take what frames say of so many keys; none before a HELLO."""
    times = BoardTimes()
    for number, frame in enumerate(received):
        keys.numbered(frame.sequence)
        with contextlib.suppress(ThenarError):
            scanner_protocol.to_board(frame)
        try:
            message = scanner_protocol.from_board(frame, keys.keys)
        except ThenarError:
            keys.misread()
        else:
            assert scanner_protocol.frame(message, frame.sequence) == frame
            assert times.stamp(message, number) <= number
            if not isinstance(message, scanner_protocol.Hello | scanner_protocol.Faults):
                keys.heard(message)
        assert keys.closed >> keys.keys == 0


FORMATS = (
    Format("cyberglove", _glove_says, altered, _glove),
    Format("scanner", _board_says, _changed_frames, _board),
)
