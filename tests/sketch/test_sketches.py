"""Sketches of every kind of wiring: what they read and send, and that the compilers of their parts take them."""

import re
import subprocess
from collections.abc import Callable
from contextlib import ExitStack
from itertools import product
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
import pytest

from thenar.compiler.firmware.targets import wired
from thenar.compiler.firmware.targets.sketch import SketchPart
from thenar.drivers.cyberglove_protocol import SENSORS_18
from thenar.drivers.emulated.cyberglove import EmulatedCyberGlove
from thenar.drivers.emulated.serial_line import PtyLine
from thenar.drivers.scanner import BoardGrasp, Scanner, ScannerReading
from thenar.runtime.scores import LANE_OFFSET

Start = Callable[..., Any]
Tool = Callable[[str], str]

PINS = (2, 3, 10, 11, 12, 13, 14, 15)
EVERY = 0xFF
LONG_S = 20.0
PICO, ESP = 'part = "rp2040"\n', 'part = "esp32"\n'
ON_PINS = "[pins]\n" + "".join(f's{key} = "GPIO{pin}"\n' for key, pin in enumerate(PINS))
ROWS, COLUMNS = (16, 17), (18, 19, 22, 23)
IN_MATRIX = (
    f"[matrix]\nrows = {[f'GPIO{pin}' for pin in ROWS]}\ncolumns = {[f'GPIO{pin}' for pin in COLUMNS]}\n"
    'switches = [["s0", "s1", "s2", "s3"], ["s4", "s5", "s6", "s7"]]\ndiodes = '
)
ON_CHIPS = (
    '[[chip]]\nkind = "mcp23017"\naddress = 0x20\npins = { GPA0 = "s0", GPA1 = "s1", GPA2 = "s2", GPB6 = "s3" }\n'
    '[[chip]]\nkind = "pca9555"\naddress = 0x21\npins = { P00 = "s4", P01 = "s5", P16 = "s6", P17 = "s7" }\n'
)
TAXELS = '[taxels]\ninputs = ["ADC0", "ADC2"]\nselect = ["GPIO4", "GPIO5", "GPIO6", "GPIO7"]\nnames = '
CASES = {
    "pins": (PICO + ON_PINS, "scan"),
    "pins, Wi-Fi": (PICO + "[wifi]\n" + ON_PINS, "scan"),
    "taxels": (PICO + ON_PINS + TAXELS + str([f"t{n}" for n in range(20)]) + "\n", "scan"),
    "taxels, straight": (
        ESP + IN_MATRIX + 'true\n[taxels]\ninputs = ["ADC1_CH0", "ADC1_CH7"]\nnames = ["a", "b"]\n',
        "scan",
    ),
    "matrix": (ESP + IN_MATRIX + "true\n", "scan"),
    "matrix without diodes": (ESP + IN_MATRIX + "false\n", "scan"),
    "chips": (ESP + "scan_us = 2000\n" + ON_CHIPS, "scan"),
    "glove, converter": (
        PICO + "scan_us = 2000\n" + ON_PINS + '[analog]\nindex_pij = "ADC0"\nthumb_rotation = "ADC2"\n',
        "glove",
    ),
    "glove, CyberGlove": (
        f"{ESP}scan_us = 3000\n[wifi]\nport = 6000\n{ON_CHIPS}[cyberglove]\nuart = 2\n",
        "glove",
    ),
    "glove, matrix": (PICO + IN_MATRIX.replace("GPIO23", "GPIO26") + "false\n[cyberglove]\n", "glove"),
}
# The chips besides the ESP32, with the compiler of each core.
XTENSA, RISCV = "ESP32, Xtensa", "ESP32-C3"
CHIPS = {"esp32s2": XTENSA, "esp32s3": XTENSA, "esp32c3": RISCV, "esp32c6": RISCV}


def on_every_pin(part: str) -> str:
    """Return the board.toml of a part with a switch on every usable pin."""
    return f'part = "{part}"\n[pins]\n' + "".join(f's{key} = "{pin}"\n' for key, pin in enumerate(wired()[part].pins))


for _part in CHIPS:
    _start = f'part = "{_part}"\nscan_us = 3000\n'
    CASES |= {
        f"{_part}, pins": (on_every_pin(_part), "scan"),
        f"{_part}, converter": (
            f'{_start}{ON_CHIPS}[analog]\nindex_pij = "ADC1_CH0"\nthumb_rotation = "ADC1_CH3"\n',
            "glove",
        ),
        f"{_part}, CyberGlove": (f"{_start}[wifi]\n{ON_CHIPS}[cyberglove]\nuart = 1\n", "glove"),
    }
FREESTANDING = Path(__file__).with_name("freestanding")
CORES = {
    XTENSA: ("xtensa-lx106-elf-", "-mlongcalls"),
    RISCV: ("riscv64-unknown-elf-", "-march=rv32imc", "-mabi=ilp32"),
    "RP2040": ("arm-none-eabi-", "-mcpu=cortex-m0plus", "-mthumb"),
}
CPP = ("-std=gnu++17", "-fno-exceptions", "-fno-rtti")


KINDS = ("pins, Wi-Fi", "taxels", "glove, converter", "glove, CyberGlove", "glove, matrix")
OF_A_CHIP = ("pins", "converter", "CyberGlove")


@pytest.mark.parametrize(
    ("core", "case"),
    [
        *product(CORES, KINDS),
        *((core, f"{part}, {kind}") for (part, core), kind in product(CHIPS.items(), OF_A_CHIP)),
    ],
)
def test_compilers_of_the_parts_have_nothing_to_say(
    written: Callable[..., Path], tool: Tool, shim: Path, tmp_path: Path, core: str, case: str
) -> None:
    """C and C++ alike, the latter against the headers that stand for Arduino's core."""
    sketch = written(tmp_path, *CASES[case])
    prefix, *flags = CORES[core]
    flags += ["-ffreestanding", f"-I{FREESTANDING}"]  # Debian has no C library for two of them
    warned = ("-Wall", "-Wextra", "-Wconversion", "-Werror", "-Os", f"-I{shim}", "-c", "-o", str(tmp_path / "object"))
    compilers = {".c": ("gcc", "-std=c99", "-pedantic"), ".cpp": ("g++", *CPP), ".ino": ("g++", *CPP)}
    found = set()
    for source in sorted(sketch.iterdir()):
        if source.suffix in compilers:
            program, *standard = compilers[source.suffix]
            language = ("-include", "Arduino.h", "-x", "c++") if source.suffix == ".ino" else ()
            command = [tool(prefix + program), *flags, *standard, *warned, *language, str(source)]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            assert (done.returncode, done.stderr) == (0, ""), source.name
            found.add(source.suffix)
    assert found == {".c", ".cpp", ".ino"}


PARTS = [name for name, part in wired().items() if isinstance(part, SketchPart)]


@pytest.mark.parametrize("part", PARTS)
def test_a_switch_on_every_usable_pin_is_read_there(
    written: Callable[..., Path], of_switches: Callable[[list[str]], Any], tmp_path: Path, part: str
) -> None:
    pins = [pin for pin in wired()[part].pins if pin not in wired()[part].uarts[0]]
    sketch = written(tmp_path, on_every_pin(part), "scan", of_switches([f"s{key}" for key in range(len(pins))]))
    lines = re.findall(r"^    (\d+)u, /\* (.*) \*/$", (sketch / "thenar_pins.cpp").read_text(), re.MULTILINE)
    assert lines == [(pin.removeprefix("GPIO"), f"{key}: s{key}") for key, pin in enumerate(pins)]


def until(scanner: Scanner, wanted: Callable[[ScannerReading], bool]) -> ScannerReading:
    """Return the first reading that is wanted."""
    end = monotonic() + LONG_S
    while monotonic() < end:
        if (reading := scanner.read(0.5)) is not None and wanted(reading):
            return reading
    raise AssertionError(f"it never came: {scanner.counts}, {scanner.faults}")


def test_switches_on_pins_by_a_serial_port(start: Start) -> None:
    board, random, closed = start(*CASES["pins"]), np.random.default_rng(1), 0
    with Scanner(board.port("serial")) as host:
        for key in random.integers(0, len(PINS), 20):
            closed ^= 1 << int(key)
            board.do(f"wire {PINS[key]} 255 {closed >> int(key) & 1}")
            now = closed
            until(host, lambda reading: reading.known == EVERY and reading.closed == now)  # noqa: B023
        assert host.counts.gaps == host.counts.damaged == 0
        assert host.hello is not None
        assert (host.hello.rows, host.hello.columns, host.hello.flags) == (1, 8, 0)


@pytest.mark.parametrize("diodes", [True, False])
def test_a_matrix_is_read_row_by_row_and_ghosts_are_known(start: Start, diodes: bool) -> None:
    board = start(*CASES["matrix" if diodes else "matrix without diodes"])
    with Scanner(board.port("serial")) as host:
        until(host, lambda reading: reading.known == EVERY and reading.closed == 0)
        board.do(f"wire {ROWS[0]} {COLUMNS[1]} 1")
        until(host, lambda reading: reading.closed == 0b10)
        board.do(f"wire {ROWS[1]} {COLUMNS[3]} 1")
        until(host, lambda reading: reading.closed == 0b1000_0010)
        if not diodes:
            board.do(f"wire {ROWS[0]} {COLUMNS[3]} 1")  # three corners: the fourth reads closed as well
            until(host, lambda reading: reading.known == EVERY & ~0b1010_1010)


# Key k, at the chip and the pin of the board.toml.
PLACES = ((32, 0), (32, 1), (32, 2), (32, 14), (33, 0), (33, 1), (33, 14), (33, 15))
AT_CHIPS = ("chip mcp23017 32", "chip pca9555 33", *(f"key {key} {at} {pin}" for key, (at, pin) in enumerate(PLACES)))


def test_port_expanders_are_set_up_read_lost_and_found(start: Start) -> None:
    board = start(*CASES["chips"])
    board.do(*AT_CHIPS)
    with Scanner(board.port("serial")) as host:
        until(host, lambda reading: reading.known == EVERY and reading.closed == 0)
        board.do("close 0 1", "close 3 1", "close 6 1")
        until(host, lambda reading: reading.known == EVERY and reading.closed == 0b0100_1001)
        board.do("plug 33 0")
        until(host, lambda reading: reading.known == 0b1111 and reading.closed == 0b1001)
        board.do("close 7 1", "plug 33 1")
        until(host, lambda reading: reading.known == EVERY and reading.closed == 0b1100_1001)
        assert host.faults is not None
        assert host.faults.bus > 0


def test_taxels_behind_multiplexers(start: Start) -> None:
    board = start(*CASES["taxels"])
    board.do("mux 26 4 5 6 7", "mux 28 4 5 6 7", *(f"tap 26 {n} {100 + n}" for n in range(16)), "tap 28 3 4095")
    with Scanner(board.port("serial")) as host:
        host.set_channels(5000, 1 << 19 | 1 << 15 | 1 << 2)
        reading = until(host, lambda reading: reading.codes is not None)
        assert reading.codes == (102, 115, 4095)
        assert host.analog is not None
        assert (host.analog.bits, host.analog.channels) == (12, 20)
        board.do("tap 26 2 7")
        until(host, lambda reading: reading.codes == (7, 115, 4095))


def test_taxels_without_multiplexers(start: Start) -> None:
    board = start(*CASES["taxels, straight"])
    board.do("analog 36 1234", "analog 35 9")
    with Scanner(board.port("serial")) as host:
        host.set_channels(2000, 0b11)
        until(host, lambda reading: reading.codes == (1234, 9))


def recognised(build: Any, bits: np.ndarray, codes: np.ndarray) -> tuple[int, int]:
    """Return the grasp type and the margin that Python finds."""
    none = np.zeros(len(bits), bool), np.zeros(len(codes), bool)
    scores = np.array(build.scorer.lanes_without(bits, codes, *none)) - LANE_OFFSET
    best, second = np.sort(scores)[::-1][:2]
    return int(np.argmax(scores)), int(best - second)


def recognises(host: Scanner, expected: tuple[int, int]) -> None:
    """Read until the board says so."""
    end = monotonic() + LONG_S
    while (grasp := host.grasp) is None or not _says(grasp, expected):
        host.read(0.05)
        assert monotonic() < end, f"{grasp} is not {expected}"


def _says(grasp: BoardGrasp, expected: tuple[int, int]) -> bool:
    return not grasp.degraded and (grasp.number, grasp.margin) == expected


@pytest.mark.parametrize("case", ["glove, converter", *(f"{part}, converter" for part in CHIPS)])
def test_a_glove_with_a_converter_recognises_as_python_does(start: Start, build: Any, case: str) -> None:
    """Switches are on pins, or on chips; the converter's pins are those of the joints' channels."""
    board, random, chip = start(*CASES[case]), np.random.default_rng(4), wired().get(case.partition(",")[0])
    assert chip is None or isinstance(chip, SketchPart)
    pins = (28, 26) if chip is None else [chip.converter[channel] for channel in ("ADC1_CH3", "ADC1_CH0")]
    board.do(*(AT_CHIPS if chip is not None else ()))
    with Scanner(board.port("serial")) as host:
        for _ in range(12):
            bits, codes = random.integers(0, 2, 8).astype(bool), random.integers(0, 256, 2)
            board.do(*(f"analog {pin} {16 * code + 15}" for pin, code in zip(pins, codes, strict=True)))
            wires = [f"wire {pin} 255" for pin in PINS] if chip is None else [f"close {key}" for key in range(8)]
            board.do(*(f"{wire} {int(bit)}" for wire, bit in zip(wires, bits, strict=True)))
            recognises(host, recognised(build, bits, codes))


def test_a_glove_in_a_wifi_recognises_from_a_cyberglove_and_chips(
    start: Start, build: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    random = np.random.default_rng(6)
    with ExitStack() as stack:
        line = stack.enter_context(PtyLine(tmp_path / "glove", 115_200))
        glove = stack.enter_context(EmulatedCyberGlove(line))
        monkeypatch.setenv("serial2", str(line.link))
        board = start(*CASES["glove, CyberGlove"])
        board.do(*AT_CHIPS)
        host = stack.enter_context(Scanner(f"udp://127.0.0.1:{board.port('udp')}"))
        for _ in range(8):
            bits, codes = random.integers(0, 2, 8).astype(bool), random.integers(1, 256, 2)
            sensors = bytearray([100] * 18)
            for name, code in zip(("thumb_rotation", "index_pij"), codes, strict=True):
                sensors[SENSORS_18.index(name)] = code
            glove.set(bytes(sensors))
            board.do(*(f"close {key} {int(bit)}" for key, bit in enumerate(bits)))
            recognises(host, recognised(build, bits, codes))
