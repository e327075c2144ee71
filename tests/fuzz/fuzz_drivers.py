"""Throws bytes at everything that reads what a device sends, and at what emulated devices read; anything but a
ThenarError is a find, and so is a frame that depends on how its bytes were cut, or a parser that stays out of step.

    python tests/fuzz/fuzz_drivers.py -runs=20000 -seed=1

The bytes are tried as they are and as the payload of a sound frame, so that the CRC does not keep them from what is
behind it.
"""

import contextlib
import sys

import atheris

with atheris.instrument_imports(include=["thenar"]):
    from thenar.drivers import cyberglove_commands, cyberglove_frame, scanner_frame, scanner_messages
    from thenar.drivers.board_keys import BoardKeys
    from thenar.drivers.board_times import BoardTimes
    from thenar.drivers.emulated.cyberglove_box import CyberGloveBox, Doubts
    from thenar.drivers.emulated.cyberglove_state import GloveState
    from thenar.drivers.emulated.scanner_board import ScannerBoard
    from thenar.drivers.errors import ThenarError
    from thenar.runtime.calibration import parse_calibration

KEYS = 40
RECORD = cyberglove_frame.Record(b"S" * 18)
STATE = scanner_frame.Frame(scanner_frame.STATE, 0, bytes(5))
COMMANDS = [
    *map(cyberglove_commands.query, cyberglove_commands.ANSWERED),
    *(cyberglove_commands.setting(letter, bytes(size)) for letter, size in cyberglove_commands.SET.items()),
    cyberglove_commands.INFORMATION,
]


def one_input(data: bytes) -> None:
    """Let every parser have `data`."""
    records(data)
    said(frames(data))
    said([scanner_frame.Frame(data[0], data[1], data[2:252])] if len(data) > 1 else [])
    answers(data)
    emulated(data)
    with contextlib.suppress(ThenarError):
        parse_calibration(data.decode("utf-8", "replace"), "glove")


def records(data: bytes) -> None:
    """Read a CyberGlove's records, at once and in two parts, and a sound one after."""
    for sensors, status in ((18, False), (22, True)):
        whole, parts = (cyberglove_frame.Decoder(sensors, status=status) for _ in range(2))
        half = len(data) // 2
        assert whole.feed(data) == parts.feed(data[:half]) + parts.feed(data[half:])
        assert len(whole._pieces._rest) < 30
    decoder = cyberglove_frame.Decoder()
    decoder.feed(data + b"\0")
    assert decoder.feed(cyberglove_frame.encode(RECORD)) == [RECORD]


def frames(data: bytes) -> list[scanner_frame.Frame]:
    """Read a scanner board's frames, at once and in two parts, and a sound one after."""
    whole, parts = scanner_frame.Decoder(), scanner_frame.Decoder()
    half = len(data) // 2
    found = whole.feed(data)
    assert found == parts.feed(data[:half]) + parts.feed(data[half:])
    assert len(whole._pieces._rest) < 260
    whole.feed(b"\0")
    assert whole.feed(scanner_frame.encode(STATE)) == [STATE]
    return found


def said(received: list[scanner_frame.Frame]) -> None:
    """Take what frames say, as the host does and as the board does."""
    for keys in (BoardKeys(1, KEYS), BoardKeys()):
        heard(received, keys)


def heard(received: list[scanner_frame.Frame], keys: BoardKeys) -> None:
    """Take what frames say of so many keys; none before a HELLO."""
    times = BoardTimes()
    for number, frame in enumerate(received):
        keys.numbered(frame.sequence)
        with contextlib.suppress(ThenarError):
            scanner_messages.to_board(frame)
        try:
            message = scanner_messages.from_board(frame, keys.keys)
        except ThenarError:
            keys.misread()
        else:
            assert scanner_messages.frame(message, frame.sequence) == frame
            assert times.stamp(message, number) <= number
            if not isinstance(message, scanner_messages.Hello | scanner_messages.Faults):
                keys.heard(message)
        assert keys.closed >> keys.keys == 0


def answers(data: bytes) -> None:
    """Look for the answer to a command, which the first byte chooses."""
    command = COMMANDS[data[0] % len(COMMANDS)] if data else COMMANDS[0]
    for last in (False, True):
        answer = cyberglove_commands.find_answer(command, data[1:], last=last)
        assert answer is None or answer.error or answer.values in data


def emulated(data: bytes) -> None:
    """Let the emulated devices have it, whose answers their drivers must understand."""
    box = CyberGloveBox(GloveState(18, 0), "CyberGlove", Doubts())
    box.feed(data)
    assert len(box._pending) < 600
    board = ScannerBoard(1, KEYS)
    for answer in scanner_frame.Decoder().feed(b"".join(board.receive(data, 0))):
        scanner_messages.from_board(answer, KEYS)


if __name__ == "__main__":
    atheris.Setup(sys.argv, one_input)
    atheris.Fuzz()
