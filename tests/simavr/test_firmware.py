"""The firmware of boards, on the simulated part, where what hangs on it is slow, in the way, or never ends."""

import subprocess
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from threading import Event, Thread
from time import monotonic
from typing import Any

import msgspec
import numpy as np
import pytest
import serial

from thenar.compiler.firmware.board import parse_board
from thenar.compiler.firmware.generate import Firmware
from thenar.drivers import scanner_protocol
from thenar.drivers.scanner import Scanner, ScannerReading
from thenar.drivers.scanner_protocol import Faults, FromBoard, GetState, Heartbeat, Hello, Lost, Ping, frame, from_board
from thenar.runtime.build import Build
from thenar.runtime.manifest import SCHEMA, Calibration, Manifest, Options, Origin, Proof, Switch, Threshold
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
        source=Origin("1" * 64, 60, "own", 160, joints=22),
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

        def start(text: str, wiring: Sequence[str], build: Build | None = None) -> Running:
            used = build or small_build()
            request = Firmware(
                used.tables,
                used.manifest,
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


def level_build() -> Build:
    """Return the small build, whose last two switches are levels of one taxel."""
    small = small_build()
    taxel = Calibration(4, "p0", "counts", 0, 0.0, 1, 1.0)
    levels = tuple(Switch(4, f"p0>{code}", 0.5, Threshold(code, code + 0.5, taxel)) for code in (300, 700))
    manifest = msgspec.structs.replace(small.manifest, switches=(*small.manifest.switches[:2], *levels))
    return Build(manifest, small.tables)


def code_of(millivolts: int) -> int:
    return min(millivolts * 1024 // 5000, 1023)


def measured(scanner: Scanner, wanted: Sequence[int]) -> ScannerReading:
    """Return the first reading of codes that lie within one of those."""
    end, last = monotonic() + MOST_S, None
    while monotonic() < end:
        reading = scanner.read(0.5)
        if reading is not None and reading.codes is not None:
            last = reading
            assert None not in reading.codes
            if all(abs((code or 0) - right) <= 1 for code, right in zip(reading.codes, wanted, strict=True)):
                return reading
    raise AssertionError(f"codes {wanted} never came, at last {last}; {scanner.counts}, {scanner.analog}")


MUX = (
    '[taxels]\ninputs = ["ADC0", "ADC3"]\nselect = ["PB1", "PB2", "PB3", "PB4"]\nsettle_us = 200\n'
    f"names = {[f'p{n}' for n in range(20)]}\n"
)
SELECT = "PB1 PB2 PB3 PB4"


def test_voltages_behind_multiplexers_arrive_at_the_host(firmware: Callable[..., Running]) -> None:
    """A channel takes 150 us to settle: one that were converted at once would have the voltage of the one before."""
    on = firmware(
        f'[pins]\ns0 = "PD2"\ns1 = "PD3"\n{MUX}',
        ["rise 0", "pin 0 PD2 GND", f"mux 0 150 {SELECT}", f"mux 3 150 {SELECT}"],
        level_build(),
    )
    millivolts = [(n * 1237) % 5000 for n in range(20)]
    on.board.do(*(f"volts {3 * (n // 16)} {n % 16} {level}" for n, level in enumerate(millivolts)))
    on.line.close()
    with Scanner(str(on.board.ports["uart0"]), BAUD) as scanner:
        assert scanner.hello is not None
        assert (scanner.hello.has_analog, scanner.hello.keys) == (True, 2)
        scanner.set_channels(1, (1 << 20) - 1)
        measured(scanner, [code_of(level) for level in millivolts])
        assert scanner.analog is not None
        assert (scanner.analog.channels, scanner.analog.bits) == (20, 10)
        # 20 conversions, and 2 for each of 16 selections, of 112 us.
        assert scanner.analog.analog_us == (20 + 2 * 16) * 112
        on.board.do("volts 0 3 4000", "volts 3 1 100", "close 0")
        chosen = [3, 16, 17]
        scanner.set_channels(1, sum(1 << n for n in chosen))
        reading = measured(scanner, [code_of(4000), code_of(millivolts[16]), code_of(100)])
        while not reading.closed:
            next_one = scanner.read(0.5)
            reading = reading if next_one is None else next_one
        assert reading.closed == 0b01
        assert scanner.faults is None  # no scan was late, no frame was dropped
        on.board.do("reset")
        measured(scanner, [code_of(4000), code_of(millivolts[16]), code_of(100)])
        assert scanner.counts.misfits == 0


def test_taxels_alone_on_inputs_of_their_own(firmware: Callable[..., Running]) -> None:
    small = level_build()
    levels = msgspec.structs.replace(small.manifest, switches=small.manifest.switches[2:])
    tables = replace(small.tables, switch_rows=small.tables.switch_rows[2:], switch_means=small.tables.switch_means[2:])
    on = firmware('[taxels]\ninputs = ["ADC1", "ADC6"]\nnames = ["p0", "p1"]\n', ["rise 0"], Build(levels, tables))
    on.board.do("volts 1 2500", "volts 6 1000")
    on.line.close()
    with Scanner(str(on.board.ports["uart0"]), BAUD) as scanner:
        scanner.set_channels(2000, 0b11)
        reading = measured(scanner, [code_of(2500), code_of(1000)])
        assert (reading.closed, reading.known) == (0, 1)
        on.board.do("volts 1 5000", "volts 6 0")
        measured(scanner, [1023, 0])
