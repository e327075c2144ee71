"""The Arduino sketch, compiled for this machine, with the parts around a board: each frame is answered as by Python."""

import dataclasses
import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from thenar.compiler.firmware.classifier import Library
from thenar.compiler.firmware.layout import Layout
from thenar.compiler.firmware.sensors import Sensors, sensors_of
from thenar.compiler.firmware.targets import TARGETS
from thenar.compiler.firmware.targets.package import Package
from thenar.compiler.firmware.tools import compile_objects
from thenar.compiler.firmware.words import numbered
from thenar.runtime.build import Build
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.manifest import Calibration, Switch, Threshold

from ....conftest import tool
from ....tables import code_of, describe
from ..conftest import make_tables

VARIANTS = Path("/usr/share/arduino/hardware/arduino/avr/variants")
# The macros of Arduino's boards.
MACROS = ("NUM_DIGITAL_PINS", "PIN_A0", "NUM_ANALOG_INPUTS")
BOARDS = {"Uno": (20, 14, 6), "Nano": (20, 14, 8), "Mega": (70, 54, 16)}


# Pins with what is wired to them: switches to ground, shift registers 74HC165 one behind the other, which take their
# inputs while PL is low and go on when CP rises, and multiplexers CD74HC4067. A line of a glove: switches, then counts.
BOARD = r"""
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
enum { LOW, HIGH, INPUT, OUTPUT, INPUT_PULLUP };
enum { A0 = 100, A1, A2, A3, A4, A5, A6, A7, A8, A9, A10, A11, A12, A13, A14, A15 };
static const int registers[] = {REGISTERS}; /* PL, CP, Q7 */
static const int analog[] = {ANALOG};
static int levels[256], modes[256], closed[256], counts[256], wired_to[256], chain[256], at;
void pinMode(int pin, int mode) { modes[pin] = mode; }
void digitalWrite(int pin, int level) {
    if (modes[pin] != OUTPUT) abort();
    if (pin == registers[0] && level == LOW) { memcpy(chain, closed, sizeof chain); at = 0; }
    if (pin == registers[1] && level == HIGH && levels[pin] == LOW) at++;
    levels[pin] = level;
}
int digitalRead(int pin) {
    if (modes[pin] != INPUT_PULLUP) abort();
#ifdef WITH_REGISTERS
    return pin == registers[2] && chain[at] ? LOW : HIGH;
#else
    return wired_to[pin] >= 0 && closed[wired_to[pin]] ? LOW : HIGH;
#endif
}
int analogRead(int pin) {
    size_t place = 0;
    while (analog[place] != pin) place++;
#ifdef ADDRESS
    static const int address[] = {ADDRESS};
    int channel = 0;
    for (int bit = 0; bit < 4; bit++) {
        if (modes[address[bit]] != OUTPUT) abort();
        channel |= levels[address[bit]] << bit;
    }
    return counts[16 * place + channel];
#else
    return counts[place];
#endif
}
void delay(int) {}
void delayMicroseconds(int) {}
static struct {
    char said[256], line[256];
    void begin(long) {}
    void print(const char *text) { strcat(line, text); }
    void print(int number) { sprintf(line + strlen(line), "%d", number); }
    void print(char letter) { if (letter == '\n') println(""); else sprintf(line + strlen(line), "%c", letter); }
    void println(const char *text) { print(text); strcpy(said, line); line[0] = 0; }
    void println(int number) { print(number); println(""); }
} Serial;
#include "Recognise.ino"
int main() {
    for (int pin = 0; pin < 256; pin++) wired_to[pin] = -1;
    static const int pins[] = {PINS -1};
    for (int n = 0; pins[n] >= 0; n++) wired_to[pins[n]] = n;
    setup();
    int number;
    for (int i = 0; scanf("%d", &number) == 1;) {
        (i < SWITCHES_THERE ? closed[i] : counts[i - SWITCHES_THERE]) = number;
        if (++i == SWITCHES_THERE + SENSORS_THERE) { loop(); puts(Serial.said); i = 0; }
    }
}
"""
GLOVE = 'name = "glove"\n[[stream]]\nport = "/dev/ttyUSB0"\njoints = {{ {} }}\ntaxels = {{ {} }}\n'
# A target, one of Arduino's boards, switches, joints and taxels of the build, and the parts that the board needs.
CASES = [
    ("arduino", "Uno", 8, 3, 1, ""),
    ("arduino", "Uno", 16, 0, 0, ""),
    ("arduino", "Uno", 17, 0, 0, ""),
    ("arduino", "Uno", 18, 0, 0, "3 74HC165"),
    ("arduino", "Uno", 19, 3, 1, "3 74HC165"),
    ("arduino", "Nano", 11, 3, 0, ""),
    ("arduino", "Nano", 12, 7, 1, "2 74HC165"),
    ("arduino", "Mega", 8, 18, 1, "2 CD74HC4067"),
    ("arduino", "Uno", 32, 17, 1, "4 74HC165 and 2 CD74HC4067"),
    ("arduino", "Uno", 0, 4, 0, ""),
    ("arduino", "Uno", 0, 0, 1, ""),
    ("arduino", "Uno", 0, 18, 0, "2 CD74HC4067"),
    ("esp32", "", 10, 5, 1, ""),
    ("esp32s2", "", 19, 10, 0, ""),
    ("esp32s3", "", 20, 8, 1, "3 74HC165"),
    ("esp32c3", "", 8, 0, 0, ""),
    ("esp32c3", "", 4, 3, 1, ""),
    ("esp32c3", "", 9, 12, 1, "2 74HC165 and 1 CD74HC4067"),
    ("esp32c6", "", 0, 5, 0, ""),
    ("rp2040", "", 19, 3, 1, "1 CD74HC4067"),
]


def build_of(switches: int, joints: int, taxels: int) -> Build:
    """Return a build of these inputs; a taxel is one level, before all but two switches."""
    tables = make_tables(seed=1, switches=switches + taxels, joints=joints)
    manifest = describe(tables)
    level = Switch(0, "pad", 0.5, Threshold(600, 0.0, Calibration(0, "pad", "counts", 0, 0.0, 1, 1.0)))
    named = manifest.switches[:2][:switches] + (level,) * taxels
    manifest = replace(
        manifest,
        switches=named + manifest.switches[len(named) :],
        joints=tuple(replace(joint, unit="raw", code_a=1, value_a=1.0, code_b=255) for joint in manifest.joints),
    )
    return Build(manifest, tables)


def expected_of(build: Build, sensors: Sensors, known: bool, closed: np.ndarray, counts: np.ndarray) -> list[str]:
    """Return Python's grasp types for rows of switches, and of the counts of joints and taxels."""
    names = [switch.name for switch in build.manifest.switches]
    # Filled in, a reading becomes a code at once, and not the byte of a stream first.
    read = [
        sensor if known else dataclasses.replace(sensor, readings=(0, 1016), grid=None) for sensor in sensors.joints
    ]
    expected = []
    for one, other in zip(closed, counts.tolist(), strict=True):
        bits = np.insert(one, names.index("pad"), other[-1] > 600) if "pad" in names else one
        codes = [code_of(sensor, count) for sensor, count in zip(read, other, strict=False)]
        expected.append(build.classify(bits, np.array(codes, np.uint16)))
    return expected


@pytest.mark.parametrize(
    ("case", "known"),
    [
        *((case, True) for case in CASES),
        *(pytest.param(case, False, marks=pytest.mark.slow) for case in CASES if case[3] + case[4]),
    ],
    ids=lambda value: "-".join(map(str, value)) if isinstance(value, tuple) else "of a glove" * value or "filled in",
)
def test_every_frame_is_answered_as_by_python(
    tmp_path: Path, case: tuple[str, str, int, int, int, str], known: bool
) -> None:
    target, board, switches, joints, taxels, parts = case
    build = build_of(switches, joints, taxels)
    manifest, layout = build.manifest, Layout(build.tables)
    ranges = ", ".join(f"{joint.name} = [0, 1016]" for joint in manifest.joints)
    harness = parse_harness(GLOVE.format(ranges, "pad = [0, 1023]" * taxels), "g") if joints + taxels else None
    sensors = sensors_of(manifest, harness)
    library = Library("hand", manifest, layout, glove=sensors if known and joints + taxels else None)
    package = TARGETS[target]
    assert isinstance(package, Package)
    values = package.example_values(library)
    needed = {"74HC165": values["registers"], "CD74HC4067": values["multiplexers"]}
    assert all(f"{count} {part}" in parts for part, count in needed.items() if part in parts)
    for path, text in package.files(library).items():
        (tmp_path / Path(path).name).write_text(text)
    if not known:
        before, table, after = (tmp_path / "Recognise.ino").read_text().partition("readings[SENSORS][2]")
        assert after.count("    {0, 0}, /*") == joints + taxels
        # What the readings are at codes 1 and 255; the counts of the taxel are its codes.
        after = after.replace("{0, 0}, /* pad", "{0, 1}, /* pad").replace("{0, 0}", "{0, 1016}")
        (tmp_path / "Recognise.ino").write_text(before + table + after)
    behind = "address_pins_behind_registers" if "165" in parts else "address_pins"
    given = {
        **(macros(board) if board else {}),
        "SWITCHES_THERE": switches,
        "SENSORS_THERE": joints + taxels,
        "REGISTERS": listed(values["register_pins"]),
        "ANALOG": listed(values["output_pins"] if "4067" in parts else dict(values["sensors"])) or "-1",
        "PINS": "".join(f"{pin}," for _, pin, _ in values["switches"] if "165" not in parts),
        "CALIBRATED": 1,
        **({"WITH_REGISTERS": 1} if "165" in parts else {}),
        **({"ADDRESS": listed(values[behind])} if "4067" in parts else {}),
    }
    (tmp_path / "board.cpp").write_text(BOARD)
    defined = [f"-D{name}={value}" for name, value in given.items()]
    sources = [path.name for path in sorted(tmp_path.glob("*.c")) if path.name != "check.c"]
    objects = compile_objects([tool("gcc")], sources, tmp_path)
    linked = [tool("g++"), *defined, "-I.", "-Wall", "-Werror", "board.cpp", *objects]
    done = subprocess.run([*linked, "-o", "board"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr

    random = np.random.default_rng(7)
    closed = random.random((300, switches)) < 0.5
    counts = random.integers(0, 1024, (300, joints + taxels))
    lines = "\n".join(" ".join(map(str, [*map(int, one), *other])) for one, other in zip(closed, counts, strict=True))
    printed = subprocess.run([tmp_path / "board"], input=lines, capture_output=True, text=True, check=True).stdout
    expected = expected_of(build, sensors, known, closed, counts)
    assert len(set(expected)) > 1
    assert printed.splitlines() == expected


def listed(pins: Any) -> str:
    """Return pins for a table in C."""
    return ",".join(map(str, pins))


def macros(board: str) -> dict[str, int]:
    """Return the macros of a board of Arduino's."""
    return dict(zip(MACROS, BOARDS[board], strict=True))


@pytest.mark.parametrize("board", BOARDS)
def test_macros_are_those_of_arduinos_core(board: str) -> None:
    variant = {"Uno": "standard", "Nano": "eightanaloginputs", "Mega": "mega"}[board]
    if not (VARIANTS / variant).is_dir():
        tool("arduino-core-avr")
    part = "atmega2560" if board == "Mega" else "atmega328p"
    command = [tool("avr-gcc"), f"-mmcu={part}", "-E", "-dM", str(VARIANTS / variant / "pins_arduino.h")]
    defined = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    found = {name: re.search(rf"#define {name} +\(?(\d+)\)?$", defined, re.MULTILINE) for name in MACROS}
    assert {name: int(match[1]) for name, match in found.items() if match is not None} == macros(board)


@pytest.mark.parametrize(
    ("target", "board", "switches", "joints", "lacks"),
    [
        ("arduino", "Uno", 2, 97, "too few analog inputs, even for one to each multiplexer"),
        ("arduino", "Nano", 2, 97, ""),
        ("esp32c3", "", 9, 16, ""),
        ("esp32c3", "", 9, 17, "too few pins, even with multiplexers"),
    ],
)
def test_the_example_for_a_board_with_too_few_pins_does_not_compile(
    target: str, board: str, switches: int, joints: int, lacks: str
) -> None:
    tables = make_tables(switches=switches, joints=joints, bins=3)
    library = Library("hand", numbered(tables), Layout(tables))
    sketch = TARGETS[target].files(library)["examples/Recognise/Recognise.ino"]
    lines = [line for line in sketch.splitlines() if "#include" not in line]
    given = [f"-D{name}={value}" for name, value in ({"CALIBRATED": 1} | (macros(board) if board else {})).items()]
    command = [tool("gcc"), "-E", "-P", "-x", "c", *given, "-"]
    done = subprocess.run(command, input="\n".join(lines), capture_output=True, text=True, check=False)
    assert (done.returncode != 0) == bool(lacks)
    assert lacks in done.stderr
