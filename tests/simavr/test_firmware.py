"""The firmware of boards, on the simulated part, where what hangs on it is slow, in the way, or never ends."""

import subprocess
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from threading import Event, Thread
from time import monotonic
from typing import Any

import numpy as np
import pytest
import serial

from thenar.compiler.firmware.board import parse_board
from thenar.compiler.firmware.generate import Firmware
from thenar.drivers import scanner_protocol
from thenar.drivers.scanner_protocol import Faults, FromBoard, GetState, Heartbeat, Hello, Lost, Ping, frame, from_board
from thenar.runtime.build import Build
from thenar.runtime.manifest import SCHEMA, Manifest, Options, Origin, Proof, Switch
from thenar.runtime.tables import IntegerTables

SWITCHES = ("s0", "s1", "s2", "s3")
BAUD = 1_000_000
MOST_S = 20.0
WATCHDOG_US = 1_020_000

PINS = '[pins]\ns0 = "PD2"\ns1 = "PD3"\ns2 = "PB0"\ns3 = "PC0"\n'
MATRIX = (
    '[matrix]\nrows = ["PD2", "PD3"]\ncolumns = ["PB0", "PB1"]\ndiodes = {}\nswitches = [["s0", "s1"], ["s2", "s3"]]\n'
)
CHIPS = (
    '[[chip]]\nkind = "mcp23017"\naddress = 0x20\npins = { GPA0 = "s0", GPA1 = "s1" }\n'
    '[[chip]]\nkind = "pca9555"\naddress = 0x21\npins = { P00 = "s2", P01 = "s3" }\n'
)


def small_build() -> Build:
    rows = np.zeros((len(SWITCHES), 2), np.int16)
    tables = IntegerTables(
        bias=np.array([1, 0], np.int16),
        switch_rows=rows,
        thresholds=(),
        joint_rows=(),
        switch_means=rows,
        joint_means=np.zeros((0, 2), np.int16),
        scale=1.0,
    )
    manifest = Manifest(
        schema=SCHEMA,
        checksum="",
        thenar="0.1.0",
        tables_sha256="0" * 64,
        ensemble_sha256="0" * 64,
        source=Origin("1" * 64, 60, "own", 160),
        options=Options(13, 100, "switches", 1.0, 4, 1),
        grasps=("open", "closed"),
        switches=tuple(Switch(number, name, 0.5) for number, name in enumerate(SWITCHES)),
        joints=(),
        proof=Proof(16, tables.scale, tables.bound, 4.5, 9.0, 60, 0),
        rates=(),
    )
    return Build(manifest, tables)


class Running:
    """Firmware on a simulated board, and the host's end of its line."""

    def __init__(self, stack: ExitStack, board: Any) -> None:
        self.board = board
        self.line = stack.enter_context(serial.Serial(str(board.ports["uart0"]), BAUD, timeout=0.2))
        self._decoder = scanner_protocol.FrameDecoder()

    def heard(self) -> list[FromBoard]:
        """Return what has come in, or comes in soon."""
        data = self.line.read(max(1, self.line.in_waiting))
        return [from_board(one, len(SWITCHES)) for one in self._decoder.feed(data)]

    def until(self, end: Callable[[FromBoard], bool]) -> list[FromBoard]:
        """Return all messages up to the first that is the `end`."""
        messages, last_s = list[FromBoard](), monotonic() + MOST_S
        while monotonic() < last_s:
            for message in self.heard():
                messages.append(message)
                if end(message):
                    return messages
        raise AssertionError(f"only {messages[-5:]} came; {self.board.said}")

    def booted(self, command: str = "reset") -> list[FromBoard]:
        """Return the messages of a boot, from its HELLO to its first HEARTBEAT."""
        self.board.do(command)
        self.until(lambda message: isinstance(message, Hello) and message.time_us < 1000)
        return self.until(lambda message: isinstance(message, Heartbeat))


@pytest.fixture
def firmware(
    program: Callable[[str], Path], simulated: Any, tmp_path: Path
) -> Iterator[Callable[[str, Sequence[str]], Running]]:
    """Return what starts the firmware of such a board.toml, wired as lines of simavr_board say."""
    with ExitStack() as stack:

        def start(text: str, wiring: Sequence[str]) -> Running:
            request = Firmware(
                small_build().tables,
                small_build().manifest,
                "avr328p",
                "scan",
                board=parse_board(f'part = "atmega328p"\n{text}'),
            )
            for name, content in request.files().items():
                (tmp_path / name).write_text(content)
            subprocess.run(["make", "-s", "-C", str(tmp_path)], check=True, timeout=120)
            lines = ["part atmega328p 16000000", f"uart 0 {BAUD} {tmp_path / 'port'}", *wiring]
            elf = next(tmp_path.glob("*.elf"))
            return Running(stack, stack.enter_context(simulated.SimulatedBoard(program("simavr_board"), lines, elf)))

        yield start


def test_a_host_that_never_stops_asking_stops_no_scan(firmware: Callable[..., Running]) -> None:
    """The watchdog would reset a board that does not scan for a second: its clock would begin anew."""
    on = firmware(PINS, ["rise 0"])
    began_us = on.booted()[-1].time_us  # type: ignore[union-attr]
    flood, enough = scanner_protocol.encode(frame(Ping(7), 0)) * 100, Event()

    def ask() -> None:
        while not enough.is_set():
            on.line.write(flood)

    asking = Thread(target=ask, name="host that asks")
    asking.start()
    try:
        end_us = began_us + 2 * WATCHDOG_US
        messages = on.until(lambda message: isinstance(message, Hello) and message.time_us > end_us)
    finally:
        enough.set()
        asking.join()
    hellos = [message for message in messages if isinstance(message, Hello)]
    times_us = [hello.time_us for hello in hellos]
    assert times_us == sorted(times_us), "the clock began anew"
    assert {hello.token for hello in hellos} == {7}
    assert len(hellos) > 1000, "it was asked, and answered, all the time"


def chip_wiring() -> list[str]:
    return ["chip mcp23017 0x20", "chip pca9555 0x21"]


def test_a_reset_in_the_middle_of_a_byte_of_a_chips_loses_no_key(firmware: Callable[..., Running]) -> None:
    """The chip holds SDA low until nine clocks have come: before anything else, the board gives them."""
    on = firmware(CHIPS, chip_wiring())
    for _ in range(5):
        messages = on.booted("inread reset") + on.until(lambda message: isinstance(message, Heartbeat))
        assert not [message for message in messages if isinstance(message, Lost | Faults)]


def test_a_chip_that_holds_the_bus_without_end_holds_up_nothing(firmware: Callable[..., Running]) -> None:
    on = firmware(CHIPS, chip_wiring())
    on.board.do("hold")
    assert [message.lost for message in on.booted() if isinstance(message, Lost)] == [0b1111]
    on.board.do("free")
    on.until(lambda message: isinstance(message, Lost) and not message.lost)


@pytest.mark.parametrize("diodes", [True, False], ids=["diodes", "no diodes"])
def test_the_wires_of_a_matrix_may_take_20_us_to_rise(firmware: Callable[..., Running], diodes: bool) -> None:
    word = "diode" if diodes else "pin"
    keys = [f"{word} {2 * row + column} PB{column} PD{row + 2}" for row in range(2) for column in range(2)]
    on = firmware(MATRIX.format(str(diodes).lower()), ["rise 20", *keys])
    for closed in (0b0000, 0b0001, 0b0010, 0b0110, 0b1001, 0b0011):
        on.board.set_keys([bool(closed >> key & 1) for key in range(len(SWITCHES))])
        (beat,) = (message for message in on.booted() if isinstance(message, Heartbeat))
        assert beat.closed == closed
        on.line.write(scanner_protocol.encode(frame(GetState(), 0)))
        again = on.until(lambda message: isinstance(message, Heartbeat))[-1]
        assert again.closed == closed  # type: ignore[union-attr]
    assert "short" not in on.board.said


def test_switches_on_pins_are_first_read_when_their_wires_have_risen(firmware: Callable[..., Running]) -> None:
    on = firmware(PINS, ["rise 90", *(f"pin {key} {pin} GND" for key, pin in enumerate(("PD2", "PD3", "PB0", "PC0")))])
    on.board.do("close 2")
    beat = on.booted()[-1]
    assert isinstance(beat, Heartbeat)
    assert beat.closed == 0b0100
