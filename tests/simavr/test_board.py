import subprocess
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import serial

from thenar.drivers.emulated.scanner import read_without_diodes
from thenar.drivers.i2c.chips import CHIPS

PARTS = ("atmega328p", "atmega2560")
BAUD = 1_000_000
MOST_S = 20.0
# Registers of both parts.
PINB, DDRB, PORTB, DDRC, PIND, DDRD, PORTD = 0x23, 0x24, 0x25, 0x27, 0x29, 0x2A, 0x2B
# What MCUSR says of a reset: at the RESET pin, for want of power.
EXTERNAL, BROWN_OUT = 0x02, 0x04


@dataclass(frozen=True, slots=True)
class Transfer:
    cycles: int
    states: bytes
    read: bytes


class Monitor:
    """The program monitor.c on a simulated board, and its serial line."""

    def __init__(self, stack: ExitStack, board: Any) -> None:
        self._stack, self.board = stack, board
        self.line = self.open()
        self.reset_by("reset", EXTERNAL)

    def open(self) -> serial.Serial:
        return self._stack.enter_context(serial.Serial(str(self.board.ports["uart0"]), BAUD, timeout=MOST_S))

    def reset_by(self, command: str, cause: int) -> None:
        self.board.do(command)
        seen = self.line.read_until(bytes((ord("B"), cause)))
        assert seen.endswith(bytes((ord("B"), cause))), seen

    def ask(self, request: bytes, length: int) -> bytes:
        self.line.write(request)
        return self.line.read(length)

    def peek(self, address: int) -> int:
        return self.ask(b"p" + address.to_bytes(2, "little"), 1)[0]

    def poke(self, address: int, value: int) -> None:
        self.ask(b"q" + address.to_bytes(2, "little") + bytes((value,)), 1)

    def transfer(self, address: int, written: bytes, to_read: int = 0) -> Transfer:
        head = self.ask(bytes((ord("t"), address, len(written), to_read)) + written, 3)
        states = self.line.read(head[2])
        read = self.line.read(to_read) if states.endswith(b"\x58") else b""
        return Transfer(int.from_bytes(head[:2], "little"), states, read)


@pytest.fixture
def monitor(
    program: Callable[[str], Path], compiled: Callable[..., Path], simulated: Any, tmp_path: Path
) -> Iterator[Callable[..., Monitor]]:
    """Return what puts the monitor on a board that is wired as its arguments say."""
    with ExitStack() as stack:

        def put(*wiring: str, part: str = PARTS[0], rise_us: int = 0) -> Monitor:
            elf = compiled(Path(__file__).with_name("monitor.c").read_text(), part)
            lines = [f"part {part} 16000000", f"uart 0 {BAUD} {tmp_path / 'port'}", f"rise {rise_us}", *wiring]
            board = stack.enter_context(simulated.SimulatedBoard(program("simavr_board"), lines, elf))
            return Monitor(stack, board)

        yield put


@pytest.mark.parametrize("part", PARTS)
def test_every_byte_goes_to_the_part_and_back(monitor: Callable[..., Monitor], part: str) -> None:
    """Written to a byte of RAM and answered, all 256 of them in one go."""
    values = np.random.default_rng(1).permutation(256).astype(np.uint8).tobytes()
    requests = b"".join(b"q" + (0x700).to_bytes(2, "little") + bytes((value,)) for value in values)
    assert monitor(part=part).ask(requests, 256) == values


def test_a_port_that_is_unplugged_dies_and_its_successor_works(monitor: Callable[..., Monitor]) -> None:
    on = monitor()
    port = on.board.ports["uart0"]
    on.board.do("uart 0 off")
    assert not port.is_symlink()
    with pytest.raises(serial.SerialException):
        on.line.read(1)
    on.board.do("uart 0 on")
    on.line = on.open()
    assert on.peek(DDRB) == 0


def test_what_is_sent_while_nobody_has_the_port_open_is_lost(monitor: Callable[..., Monitor]) -> None:
    on = monitor()
    on.line.close()
    on.board.do("reset")
    on.board.do("free")  # after what it says at a reset
    on.line = on.open()
    assert on.peek(PINB) == 0


def test_resets_begin_the_program_anew_and_say_why(monitor: Callable[..., Monitor]) -> None:
    on = monitor()
    on.poke(DDRB, 0x15)
    on.reset_by("reset", EXTERNAL)
    assert on.peek(DDRB) == 0
    on.poke(0x700, 0x42)
    on.reset_by("reset", EXTERNAL)
    assert on.peek(0x700) == 0x42
    on.reset_by("brownout 5000", BROWN_OUT)
    assert [on.peek(0x700 + place) for place in range(8)] != [0x42] + [0] * 7


def test_a_command_for_within_a_frame_waits_for_its_third_byte(monitor: Callable[..., Monitor]) -> None:
    on = monitor()
    on.poke(0x700, 0)  # a 0 goes out: what follows is a frame
    on.board.tell("inframe reset")
    values = bytes((1, 2, 3))
    requests = b"".join(b"q" + (0x700).to_bytes(2, "little") + bytes((value,)) for value in values)
    assert on.ask(requests, 5) == values + bytes((ord("B"), EXTERNAL))
    on.board.done()


def test_the_program_is_never_ahead_of_time_and_stands_still_without_power(monitor: Callable[..., Monitor]) -> None:
    on = monitor()
    before = on.board.do("free")
    on.reset_by("brownout 300000", BROWN_OUT)
    after = on.board.do("free")
    # From the program's own time, which may have been behind: it makes up for that.
    passed_us, slice_us = after.time_us - before.board_us - 300_000, 500
    assert 0 < after.cycle - before.cycle <= 16 * (passed_us + 2 * slice_us)


def test_a_switch_pulls_its_pin_down_against_the_pull_up_and_drives_nothing_else(
    monitor: Callable[..., Monitor],
) -> None:
    on = monitor("pin 7 PD2 GND", "pin 8 PD6 GND")
    assert on.peek(PIND) == 0, "without pull-up pins float, and read 0 here"
    on.poke(PORTD, 0xFC)
    assert on.peek(PIND) == 0xFC
    on.board.do("close 7")
    assert on.peek(PIND) == 0xF8
    on.board.do("close 8", "open 7")
    assert on.peek(PIND) == 0xBC
    on.poke(DDRD, 0x08)
    on.poke(PORTD, 0xF4)
    assert on.peek(PIND) == 0xB4, "an output reads what it drives"
    assert "short" not in on.board.said
    on.poke(DDRD, 0x40)
    assert "short circuit, PD6 is driven high and pulled low" in on.board.said


@pytest.mark.parametrize("diodes", [True, False], ids=["diodes", "no diodes"])
def test_a_matrix_reads_as_it_should_for_any_keys(monitor: Callable[..., Monitor], diodes: bool) -> None:
    rows, columns = 5, 6
    word = "diode" if diodes else "pin"
    keys = [
        f"{word} {row * columns + column} PD{column + 2} PB{row}" for row in range(rows) for column in range(columns)
    ]
    on = monitor(*keys, rise_us=3)
    on.poke(PORTD, 0xFC)
    rng = np.random.default_rng(2)
    for share in np.linspace(0, 1, 40):
        pressed = rng.random(rows * columns) < share
        on.board.set_keys(pressed.tolist())
        mask = sum(1 << int(key) for key in np.flatnonzero(pressed))
        wanted = mask if diodes else read_without_diodes(mask, rows, columns)
        seen = on.ask(bytes((ord("m"), 0, rows - 1)), rows)
        found = sum((~byte >> 2 & 0x3F) << row * columns for row, byte in enumerate(seen))
        assert found == wanted, f"{mask:x}"


def test_a_wire_that_is_read_before_it_has_risen_still_reads_low(monitor: Callable[..., Monitor]) -> None:
    keys = ("diode 0 PD2 PB0", "diode 1 PD3 PB1")
    slow, fast = monitor(*keys, rise_us=20), monitor(*keys, rise_us=2)
    for on in (slow, fast):
        on.poke(PORTD, 0xFC)
        on.board.do("close 0", "close 1")
    assert fast.ask(bytes((ord("m"), 0, 1)), 2) == bytes((0xF8, 0xF4))
    assert slow.ask(bytes((ord("m"), 0, 1)), 2) == bytes((0xF8, 0xF0))


def test_two_bytes_from_a_register_take_48_periods_of_scl_and_the_interrupts(monitor: Callable[..., Monitor]) -> None:
    """1920 cycles of the wire at 400 kHz; with interrupts, another simulator took 2411 to 2417."""
    on = monitor("chip mcp23017 0x20")
    done = on.transfer(0x20, b"\x12", 2)
    assert done.states == bytes.fromhex("08 18 28 10 40 50 58")
    print(f"{done.cycles} cycles")
    assert 2300 < done.cycles < 2600
    twbr = 0xB8
    on.poke(twbr, 72)  # 100 kHz
    assert on.transfer(0x20, b"\x12", 2).cycles - done.cycles == pytest.approx(48 * (160 - 40), abs=40)


def test_a_chip_that_is_not_there_does_not_acknowledge(monitor: Callable[..., Monitor]) -> None:
    on = monitor("chip mcp23017 0x20")
    assert on.transfer(0x21, b"\x12", 2).states == bytes((0x08, 0x20))
    assert on.transfer(0x21, b"", 1).states == bytes((0x08, 0x48))
    on.transfer(0x20, b"\x00\x0f")
    on.board.do("unplug 0x20")
    assert on.transfer(0x20, b"\x00", 1).states == bytes((0x08, 0x20))
    on.board.do("replug 0x20")
    assert on.transfer(0x20, b"\x00", 1).read == b"\xff", "registers are as after power-on"


def test_a_bus_that_is_held_stands_still_until_it_is_free(monitor: Callable[..., Monitor]) -> None:
    on = monitor("chip mcp23017 0x20")
    on.board.do("hold")
    assert on.transfer(0x20, b"\x00", 1).states == b""
    on.board.do("free")
    assert on.transfer(0x20, b"\x00", 1).read == b"\xff"


def test_a_chip_that_was_sending_at_a_reset_holds_the_bus_for_nine_clocks(monitor: Callable[..., Monitor]) -> None:
    on = monitor("chip mcp23017 0x20")
    on.board.tell("inread reset")
    on.line.write(bytes((ord("t"), 0x20, 1, 2, 0)))
    assert on.line.read_until(bytes((ord("B"), EXTERNAL))).endswith(bytes((ord("B"), EXTERNAL)))
    on.board.done()
    for _ in range(9):
        assert on.transfer(0x20, b"\x00", 1).states == b""
        on.poke(DDRC, 0x20)
        on.poke(DDRC, 0)
    assert on.transfer(0x20, b"\x00", 1).read == b"\xff"


def test_a_start_waits_until_the_bus_is_free(monitor: Callable[..., Monitor]) -> None:
    on, twcr, twsr = monitor(), 0xBC, 0xB9
    on.board.do("hold")
    on.poke(twcr, 0xA4)
    assert not on.peek(twcr) & 0x80
    on.board.do("free")
    assert on.peek(twcr) & 0x80, "polled as well as by interrupts"
    assert on.peek(twsr) == 0x08


@pytest.mark.parametrize("kind", ["mcp23017", "mcp23008", "pca9555", "tca9555", "tca6424a"])
def test_chips_do_as_the_models_that_the_drivers_are_tested_with(monitor: Callable[..., Monitor], kind: str) -> None:
    """Random writes, reads with and without a register, and switches: all bytes equal."""
    model = CHIPS[kind].model()
    on = monitor(f"chip {kind} 0x22", *(f"key {pin} 0x22 {pin} low" for pin in range(model.pins)))
    rng = np.random.default_rng(3)
    registers = 0x10 if kind == "tca6424a" else 0x16
    for _ in range(150):
        pressed = rng.random(model.pins) < 0.5
        on.board.set_keys(pressed.tolist())
        model.levels = sum(1 << int(pin) for pin in np.flatnonzero(~pressed))
        written = bytes(rng.integers(0, 256, int(rng.integers(0, 4))).astype(np.uint8))
        if written:
            automatic = int(rng.integers(2)) << 7 if kind == "tca6424a" else 0
            written = bytes((int(rng.integers(registers)) | automatic,)) + written[1:]
        to_read = int(rng.integers(0 if written else 1, 5))
        if written:
            model.write(written)
        done = on.transfer(0x22, written, to_read)
        assert done.read == (model.read(to_read) if to_read else b""), (written, to_read)


def test_a_switch_may_close_upwards(monitor: Callable[..., Monitor]) -> None:
    on = monitor("chip mcp23017 0x20", "key 0 0x20 9 high")
    on.transfer(0x20, b"\x0c\xff\xff")
    assert on.transfer(0x20, b"\x12", 2).read == b"\xff\xfd"
    on.board.do("close 0")
    assert on.transfer(0x20, b"\x12", 2).read == b"\xff\xff"


def test_analog_inputs_read_their_voltage(monitor: Callable[..., Monitor]) -> None:
    on = monitor()
    adcl, adch, adcsra, admux = 0x78, 0x79, 0x7A, 0x7C
    for channel, millivolts in ((0, 0), (3, 1250), (5, 4999)):
        on.board.do(f"volts {channel} {millivolts}")
        on.poke(admux, 0x60 | channel)  # of AVCC, the upper eight bits in ADCH
        on.poke(adcsra, 0xC7)
        while on.peek(adcsra) & 0x40:
            pass
        on.peek(adcl)
        assert on.peek(adch) == pytest.approx(256 * millivolts / 5000, abs=1)


@pytest.mark.parametrize(
    ("wiring", "said"),
    [
        ("", "is empty"),
        ("uart 0 1000000 /nowhere", "must begin with the part"),
        ("part z80 1000", 'simavr knows no "z80"'),
        ("part atmega328p fast", '"fast" is no clock'),
        ("part atmega328p 16000000\nuart 3 115200 /nowhere/port", "the part has no UART 3"),
        ("part atmega328p 16000000\nuart 0 115200 /nowhere/port", "/nowhere/port cannot be made"),
        ("part atmega328p 16000000\nrise 0\npin 0 PX9 GND", 'the part has no pin "PX9"'),
        ("part atmega328p 16000000\nchip pcf1 0x20", 'no chip "pcf1" is modelled'),
        ("part atmega328p 16000000\nkey 0 0x20 1 low", "key 0: there is no pin 1 at 0x20"),
        ("part atmega328p 16000000\nbell 1", 'the wiring has a line "bell" with 2 words'),
    ],
)
def test_wiring_that_cannot_be_is_told(
    program: Callable[[str], Path], compiled: Callable[..., Path], tmp_path: Path, wiring: str, said: str
) -> None:
    file = tmp_path / "wiring"
    file.write_text(wiring)
    command = [str(program("simavr_board")), str(file), str(compiled("int main(void) { for (;;); }", PARTS[0]))]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, timeout=60, check=False)
    assert done.returncode == 2
    assert said in done.stderr.decode().splitlines()[-1]


def test_commands_that_cannot_be_done_are_refused(monitor: Callable[..., Monitor]) -> None:
    board = monitor("pin 0 PD2 GND").board
    for command in ("close 1", "unplug 0x20", "uart 2 off", "volts 8 1", "volts 99 1", "sing", "set"):
        with pytest.raises(AssertionError, match="cannot do that"):
            board.do(command)
