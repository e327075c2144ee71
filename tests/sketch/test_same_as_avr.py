"""A sketch and an AVR's firmware of the same build say the same of the same switches, and answer the same."""

import importlib.util
import subprocess
import sys
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from time import monotonic
from typing import Any

import pytest
import serial

from thenar.compiler.firmware.board import parse_board
from thenar.compiler.firmware.generate import Firmware
from thenar.compiler.firmware.simavr import harness, missing
from thenar.drivers import scanner_protocol
from thenar.drivers.scanner_protocol import (
    Event,
    Faults,
    FrameDecoder,
    FromBoard,
    GetState,
    Heartbeat,
    Hello,
    Lost,
    Ping,
    SetDebounce,
    SetRate,
    ToBoard,
    frame,
    from_board,
)

KEYS, BAUD, LONG_S = 8, 1_000_000, 20.0
CHIPS = (
    'board = 9\nscan_us = 3000\n[[chip]]\nkind = "mcp23017"\naddress = 0x20\n'
    'pins = { GPA0 = "s0", GPA1 = "s1", GPA2 = "s2", GPB6 = "s3" }\n'
    '[[chip]]\nkind = "pca9555"\naddress = 0x21\npins = { P00 = "s4", P01 = "s5", P16 = "s6", P17 = "s7" }\n'
)
PLACES = ((0x20, 0), (0x20, 1), (0x20, 2), (0x20, 14), (0x21, 0), (0x21, 1), (0x21, 14), (0x21, 15))
CLOSED = (0, 7, 3, 0, 5, 6, 7, 1, 3, 2)  # each changes this key


class Board:
    """Either board: `wire` does something to its switches and chips, and messages come from a serial port."""

    def __init__(self, stack: ExitStack, port: str, wire: Callable[[str, int, int], None]) -> None:
        self.line = stack.enter_context(serial.Serial(port, BAUD, timeout=0.2))
        self.wire = wire
        self._decoder = FrameDecoder()
        self._sent = 0

    def say(self, message: ToBoard) -> None:
        self.line.write(scanner_protocol.encode(frame(message, self._sent)))
        self._sent += 1

    def until(self, end: Callable[[FromBoard], bool]) -> FromBoard:
        last_s = monotonic() + LONG_S
        while monotonic() < last_s:
            for one in self._decoder.feed(self.line.read(max(1, self.line.in_waiting))):
                if end(message := from_board(one, KEYS)):
                    return message
        raise AssertionError("it never came")


def timeless(message: FromBoard) -> FromBoard:
    return message if isinstance(message, Lost) else replace(message, time_us=0)  # type: ignore[call-arg]


def conversation(board: Board) -> list[FromBoard]:
    """Return what a board says while its switches change, and it is asked, and what it is asked is wrong."""
    said = []

    def hear(end: Callable[[FromBoard], bool]) -> None:
        said.append(timeless(board.until(end)))

    board.say(Ping(4))
    hear(lambda message: isinstance(message, Hello) and message.token == 4)
    board.until(lambda message: isinstance(message, Heartbeat))
    closed = 0
    for key in CLOSED:
        closed ^= 1 << key
        board.wire("close", key, closed >> key & 1)
        hear(lambda message: isinstance(message, Event))
    board.say(GetState())
    hear(lambda message: isinstance(message, Heartbeat))
    board.wire("plug", 0x21, 0)
    hear(lambda message: isinstance(message, Lost) and message.lost != 0)
    board.wire("plug", 0x21, 1)
    hear(lambda message: isinstance(message, Lost) and message.lost == 0)
    board.say(SetDebounce(4000, 9000))
    hear(lambda message: isinstance(message, Hello) and not message.token)
    board.say(SetRate(1, 0, 1))
    scanned = board.until(lambda message: isinstance(message, Hello) and not message.token)
    assert isinstance(scanned, Hello)
    assert scanned.heartbeat_us == scanned.scan_us > 1, "never faster than its scans"
    board.say(SetRate(5000, 0, 0))
    hear(lambda message: isinstance(message, Hello) and message.heartbeat_us == 0)
    refused = scanner_protocol.encode(frame(Ping(5), 0))
    board.line.write(b"\0" + refused[:-2] + b"\xff\0" + b"\1\1\0" + refused)
    hear(lambda message: isinstance(message, Hello) and message.token == 5)
    faults = board.until(lambda message: isinstance(message, Faults) and message.refused > 0)
    assert isinstance(faults, Faults)
    assert faults.bus > 0, "chips that were not there"
    said.append(Faults(0, 0, faults.refused, faults.dropped, 0))
    return said


@pytest.fixture
def avr(tool: Callable[[str], str], build: Any, stack: ExitStack, tmp_path: Path) -> Board:
    """The AVR's firmware in simavr."""
    for name in ("avr-gcc", "make"):
        tool(name)
    if missing() is not None:
        tool("libsimavr-dev")
    at = Path(__file__).parents[1] / "simavr" / "simulated.py"
    spec = importlib.util.spec_from_file_location("simulated", at)
    assert spec is not None
    assert spec.loader is not None
    simulated = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = simulated
    spec.loader.exec_module(simulated)
    board = parse_board('part = "atmega328p"\n' + CHIPS)
    for name, text in Firmware(build.tables, build.manifest, "avr328p", "scan", board=board).files().items():
        (tmp_path / name).write_text(text)
    subprocess.run(["make", "-s", "-C", str(tmp_path)], check=True, timeout=120)
    lines = [
        "part atmega328p 16000000",
        f"uart 0 {BAUD} {tmp_path / 'port'}",
        "chip mcp23017 0x20",
        "chip pca9555 0x21",
    ]
    lines += [f"key {key} {at} {pin} low" for key, (at, pin) in enumerate(PLACES)]  # type: ignore[assignment]
    running = stack.enter_context(
        simulated.SimulatedBoard(harness("simavr_board"), lines, next(tmp_path.glob("*.elf")))
    )
    words = {("close", 0): "open", ("close", 1): "close", ("plug", 0): "unplug", ("plug", 1): "replug"}
    return Board(stack, str(running.ports["uart0"]), lambda what, which, on: running.do(f"{words[what, on]} {which}"))


@pytest.fixture
def sketch(start: Callable[..., Any], stack: ExitStack) -> Board:
    """The sketch on this machine."""
    running = start('part = "esp32"\n' + CHIPS)
    keys = (f"key {key} {at} {pin}" for key, (at, pin) in enumerate(PLACES))
    running.do("chip mcp23017 32", "chip pca9555 33", *keys)
    return Board(stack, running.port("serial"), lambda what, which, on: running.do(f"{what} {which} {on}"))


def test_both_say_the_same(avr: Board, sketch: Board) -> None:
    said = conversation(sketch)
    assert [message.key for message in said if isinstance(message, Event)] == list(CLOSED)
    assert said == conversation(avr)
