"""Readings become codes on a microcontroller as in Python: run in the emulators of all cores."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from thenar.compiler.firmware.classifier import Library
from thenar.compiler.firmware.layout import Layout
from thenar.compiler.firmware.sensors import Sensors, sensors_of
from thenar.compiler.firmware.targets import TARGETS
from thenar.compiler.firmware.targets.avr import harness
from thenar.compiler.firmware.tools import STRICT, call, find, workshop
from thenar.drivers.calibration import GloveCalibration, SensorCalibration
from thenar.runtime.harness.loading import parse_harness

from ....conftest import tool
from ....tables import calibrated_glove, code_of, describe
from ..conftest import make_tables

STREAM = """
name = "glove"
[[stream]]
port = "/dev/ttyUSB0"
joints = { j0 = [1023, -200], j1 = [0, 1016], j2 = [200, 4095] }
"""
BARE = """
#include "semihosting.h"
#include "thenar_hand_codes.h"
void thenar_fault(void);
void thenar_fault(void)
{
    for (;;) {
        semihosting_exit(true);
    }
}
int main(void)
{
    static thenar_hand_codes codes;
    const uint32_t answers = semihosting_open("predictions", 11, SEMIHOSTING_WB);
    bool whole = true;

    thenar_hand_codes_init(&codes);
    for (uint16_t sensor = 0; sensor < THENAR_HAND_SENSORS; ++sensor) {
        for (int32_t reading = %(first)d; reading < %(last)d; reading += %(step)d) {
            const uint16_t code = thenar_hand_code_of(&codes, sensor, reading);
            uint8_t bytes[2] = {(uint8_t)(code & 0xffu), (uint8_t)(code >> 8)};

            whole = semihosting_write(answers, bytes, 2) && whole;
        }
    }
    semihosting_exit(!whole);
    return 0;
}
"""
AVR = """
#include "thenar_hand_codes.h"
struct {
    int32_t reading;
    uint16_t sensor;
} asked;
uint16_t found;
static thenar_hand_codes codes;
void answer(void);
__attribute__((noinline, noclone)) void answer(void)
{
    found = thenar_hand_code_of(&codes, asked.sensor, asked.reading);
}
int main(void)
{
    thenar_hand_codes_init(&codes);
    for (;;) {
        answer();
    }
}
"""


@pytest.fixture(params=["stream", "cyberglove"])
def library(request: pytest.FixtureRequest, tmp_path: Path) -> Callable[[bool], Library]:
    """Return what makes the library of a glove, for an AVR or not."""
    tables = make_tables(switches=2, joints=3)
    manifest = describe(tables)  # degrees, half of one a code
    if request.param == "stream":
        manifest = replace(manifest, joints=tuple(replace(joint, unit="ohm") for joint in manifest.joints))
        sensors = sensors_of(manifest, parse_harness(STREAM, "glove.toml"))
    else:
        fine = tuple(
            replace(joint, code_a=3, value_a=-17.3, code_b=65000, value_b=91.7) for joint in manifest.joints[1:]
        )
        manifest = replace(manifest, joints=(manifest.joints[0], *fine))
        lines = zip((40, 200, 1), (160, 77, 255), (90.0, 33.3, 100.0), strict=True)
        hand = [SensorCalibration(f"j{n}", first, 0.0, last, value) for n, (first, last, value) in enumerate(lines)]
        sensors = sensors_of(manifest, calibrated_glove(tmp_path, GloveCalibration(sensors=tuple(hand))))

    return lambda avr: Library("hand", manifest, Layout(tables), glove=sensors)


def python_s(sensors: Sensors, readings: Sequence[int]) -> list[int]:
    return [code_of(sensor, reading) for sensor in sensors.every for reading in readings]


@pytest.mark.parametrize(
    "name", ["cortex-m0plus", *(pytest.param(core, marks=pytest.mark.slow) for core in ("cortex-m4", "rv32imac"))]
)
def test_codes_are_python_s_in_an_emulator(library: Callable[[bool], Library], cores: Any, name: str) -> None:
    made, readings = library(False), range(-70_000, 70_000, 41)
    given = {"first": readings.start, "last": readings.stop, "step": readings.step}
    files = {path: text for path, text in made.whole.items() if path.endswith((".c", ".h"))}
    written = cores[name].emulate({**files, "main.c": BARE % given})
    assert np.frombuffer(written, "<u2").tolist() == python_s(made.sensors, readings)


def test_codes_are_python_s_on_an_avr(library: Callable[[bool], Library]) -> None:
    target, made, readings = TARGETS["avr328p"], library(True), [*range(-70_000, 70_000, 411), *range(256)]
    if missing := target.missing():
        tool(missing.split()[0])
    assert target.compiler is not None
    asked = [(reading, number) for number in range(len(made.sensors.every)) for reading in readings]
    sent = np.array(asked, [("reading", "<i4"), ("sensor", "<u2")]).tobytes()
    program = harness("simavr_classify")
    with workshop({**made.whole, "main.c": AVR}) as folder:
        sources = sorted(path for path in (*made.whole, "main.c") if path.endswith((".c", ".S")))
        call([find(target.compiler), *STRICT, *target.flags, *sources, "-o", "codes.elf"], folder)
        lines = call(["avr-nm", "--format=posix", "codes.elf"], folder).decode().splitlines()
        at = {words[0]: hex(int(words[2], 16)) for words in map(str.split, lines) if len(words) > 2}
        places = [at["answer"], at["_end"], f"{at['asked']}:6", f"{at['found']}:2"]
        printed = call([str(program), target.part, "16000000", "codes.elf", *places], folder, sent)
    answers = np.frombuffer(printed, [("code", "<u2"), ("grasp", "<u2"), ("cycles", "<u4"), ("stack", "<u2")])
    assert answers["code"].tolist() == python_s(made.sensors, readings)
    print(f"{np.median(answers['cycles']):.0f} cycles, at most {answers['cycles'].max()}")
    # Of a simulated part, the same on every machine. Numbers of a stream are coded on their own grid first.
    assert answers["cycles"].max() < (1000 if made.sensors.on_pins else 500)
