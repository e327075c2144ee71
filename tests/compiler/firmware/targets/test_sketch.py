"""The Arduino sketch, compiled for this machine, with the parts around a board: each frame is answered as by Python."""

import dataclasses
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from thenar.compiler.firmware.classifier import Library
from thenar.compiler.firmware.layout import arrange
from thenar.compiler.firmware.sensors import sensors_of
from thenar.compiler.firmware.targets import TARGETS
from thenar.compiler.firmware.targets.package import Wiring
from thenar.compiler.firmware.words import numbered
from thenar.runtime.build import Build
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.manifest import Calibration, Manifest, Switch, Threshold
from thenar.runtime.tables import IntegerTables

MakeTables = Callable[..., IntegerTables]
Describe = Callable[[IntegerTables], Manifest]

# Pins with what is wired to them: switches to ground, shift registers 74HC165 one behind the other, which take their
# inputs while PL is low and go on when CP rises, and multiplexers CD74HC4067. A line of a glove: switches, then counts.
BOARD = r"""
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string>
#include <vector>
enum { LOW, HIGH, INPUT, OUTPUT, INPUT_PULLUP };
enum { A0 = 100, A1, A2, A3, A4, A5, A6, A7, A8, A9, A10, A11, A12, A13, A14, A15 };
static int levels[64], modes[64], closed[256], counts[256], wired_to[256];
static std::vector<int> chain;
static size_t at;
void pinMode(int pin, int mode) { modes[pin] = mode; }
void digitalWrite(int pin, int level) {
    if (modes[pin] != OUTPUT) abort();
    if (pin == 2 && level == LOW) { chain.assign(closed, closed + 256); at = 0; }
    if (pin == 3 && level == HIGH && levels[3] == LOW) at++;
    levels[pin] = level;
}
int digitalRead(int pin) {
    if (modes[pin] != INPUT_PULLUP) abort();
#ifdef WITH_REGISTERS
    return pin == 4 && chain[at] ? LOW : HIGH;
#else
    return wired_to[pin] >= 0 && closed[wired_to[pin]] ? LOW : HIGH;
#endif
}
int analogRead(int pin) {
#ifdef ADDRESS
    static const int address[] = {ADDRESS};
    int channel = 0;
    for (int bit = 0; bit < 4; bit++) {
        if (modes[address[bit]] != OUTPUT) abort();
        channel |= levels[address[bit]] << bit;
    }
    return counts[16 * (pin - A0) + channel];
#else
    return counts[pin - A0];
#endif
}
void delay(int) {}
void delayMicroseconds(int) {}
static struct {
    std::string said, line;
    void begin(long) {}
    void print(int number) { line += std::to_string(number); }
    void print(char letter) { if (letter == '\n') println(""); else line += letter; }
    void print(const char *text) { line += text; }
    void println(const char *text) { said = line + text; line = ""; }
    void println(int number) { said = line + std::to_string(number); line = ""; }
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
        if (++i == SWITCHES_THERE + SENSORS_THERE) { loop(); puts(Serial.said.c_str()); i = 0; }
    }
}
"""
GLOVE = 'name = "glove"\n[[stream]]\nport = "/dev/ttyUSB0"\njoints = {{ {} }}\ntaxels = {{ pad = [0, 1023] }}\n'


@pytest.mark.parametrize(
    ("switches", "joints", "pins", "parts"),
    [
        (9, 3, (14, 6), ""),
        (20, 3, (14, 6), "3 74HC165"),
        (9, 18, (20, 6), "2 CD74HC4067"),
        (33, 17, (14, 6), "4 74HC165 and 2 CD74HC4067"),
    ],
    ids=["pins", "registers", "multiplexers", "both"],
)
@pytest.mark.parametrize("known", [True, False], ids=["of a glove", "filled in"])
def test_every_frame_is_answered_as_by_python(
    tool: Callable[[str], str],
    make_tables: MakeTables,
    describe: Describe,
    tmp_path: Path,
    switches: int,
    joints: int,
    pins: tuple[int, int],
    parts: str,
    known: bool,
) -> None:
    tables = make_tables(seed=3, switches=switches, joints=joints)
    manifest = describe(tables)
    level = Threshold(600, 0.0, Calibration(0, "pad", "counts", 0, 0.0, 1, 1.0))
    manifest = replace(
        manifest,
        switches=(*manifest.switches[:2], Switch(0, "pad", 0.5, level), *manifest.switches[3:]),
        joints=tuple(replace(joint, unit="raw", code_a=1, value_a=1.0, code_b=255) for joint in manifest.joints),
    )
    harness = parse_harness(GLOVE.format(", ".join(f"{joint.name} = [0, 1016]" for joint in manifest.joints)), "g")
    sensors = sensors_of(manifest, harness)
    library = Library("hand", manifest, arrange(tables), avr=False, glove=sensors if known else None)
    wiring = Wiring.of(library)
    assert wiring.on(*pins) == parts
    for path, text in TARGETS["arduino"].files(library).items():
        (tmp_path / Path(path).name).write_text(text)
    if not known:
        sketch = (tmp_path / "Recognise.ino").read_text()
        assert sketch.count("    {0, 0}, /*") == joints + 1
        # What the readings are at codes 1 and 255; the counts of the taxel are its codes.
        sketch = sketch.replace("{0, 0}, /* pad", "{0, 1}, /* pad").replace("{0, 0}", "{0, 1016}")
        (tmp_path / "Recognise.ino").write_text(sketch)
    given = {
        "NUM_DIGITAL_PINS": sum(pins),
        "NUM_ANALOG_INPUTS": pins[1],
        "SWITCHES_THERE": switches - 1,
        "SENSORS_THERE": joints + 1,
        "PINS": "".join(f"{pin}," for pin in wiring.switches.values()),
        "CALIBRATED": 1,
        **({"WITH_REGISTERS": 1} if "165" in parts else {}),
        **(
            {"ADDRESS": "5,6,7,8" if "165" in parts else ",".join(map(str, wiring.addresses))}
            if "4067" in parts
            else {}
        ),
    }
    (tmp_path / "board.cpp").write_text(BOARD)
    defined = [f"-D{name}={value}" for name, value in given.items()]
    sources = [str(path) for path in sorted(tmp_path.glob("*.c")) if path.name != "check.c"]
    objects = subprocess.run([tool("gcc"), "-c", *sources], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert objects.returncode == 0, objects.stderr
    linked = [tool("g++"), *defined, "-I.", "-Wall", "-Werror", "board.cpp", *(str(p) for p in tmp_path.glob("*.o"))]
    done = subprocess.run([*linked, "-o", "board"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr

    random = np.random.default_rng(7)
    closed = random.random((80, switches - 1)) < 0.5
    counts = random.integers(0, 1024, (80, joints + 1))
    lines = "\n".join(" ".join(map(str, [*map(int, one), *other])) for one, other in zip(closed, counts, strict=True))
    printed = subprocess.run([tmp_path / "board"], input=lines, capture_output=True, text=True, check=True).stdout
    build = Build(manifest, tables)
    # Filled in, a reading becomes a code at once, and not the byte of a stream first.
    read = [
        sensor if known else dataclasses.replace(sensor, readings=(0, 1016), grid=None) for sensor in sensors.joints
    ]
    expected = []
    for one, other in zip(closed, counts.tolist(), strict=True):
        bits = np.insert(one, 2, other[-1] > 600)
        codes = [sensor.code(count) for sensor, count in zip(read, other[:-1], strict=True)]
        expected.append(build.classify(bits, np.array(codes, np.uint16)))
    assert len(set(expected)) > 2
    assert printed.splitlines() == expected


def test_a_library_says_which_boards_the_example_fits(make_tables: MakeTables) -> None:
    def said(switches: int, joints: int) -> str:
        tables = make_tables(switches=switches, joints=joints)
        return TARGETS["arduino"].said(Library("hand", numbered(tables), arrange(tables), avr=False))

    assert said(9, 3) == "the example Recognise fits Arduino Uno and Nano and Mega as it is"
    assert said(20, 7) == (
        "the example Recognise fits Arduino Uno with 3 74HC165 and 1 CD74HC4067; Nano with 3 74HC165; Mega as it is"
    )
