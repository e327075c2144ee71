"""Readings become codes in the C of firmware as they do in Python: every reading, of many calibrations."""

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from msgspec import structs

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.classifier import Library
from thenar.compiler.firmware.layout import Layout
from thenar.compiler.firmware.sensors import Sensor, Sensors, sensors_of
from thenar.compiler.firmware.words import numbered
from thenar.drivers.calibration import GloveCalibration, SensorCalibration
from thenar.drivers.errors import SettingError
from thenar.runtime.calibration import CodeTables, codes_of_bytes, numbers_of
from thenar.runtime.code_line import FARTHEST, CodeLine
from thenar.runtime.harness.loading import load_harness, parse_harness
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.manifest import Calibration, Manifest, Switch, Threshold
from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.sources.rows import _Grid, steps_of
from thenar.runtime.taxels import TaxelCalibration, count_limit

from ..gloves import pad_line
from ..tables import calibrated_glove, code_of, grid_code

SharedLibrary = Callable[..., ctypes.CDLL]

READINGS = range(-FARTHEST - 300, FARTHEST + 301)
SWEEP = """
#include "thenar_hand_codes.h"
void sweep(const thenar_hand_codes *codes, uint16_t sensor, int32_t from, int32_t to, uint16_t *found);
void sweep(const thenar_hand_codes *codes, uint16_t sensor, int32_t from, int32_t to, uint16_t *found)
{
    for (int32_t reading = from; reading < to; ++reading) {
        found[reading - from] = thenar_hand_code_of(codes, sensor, reading);
    }
}
"""
TAKE = """
#include "thenar_hand_codes.h"
uint32_t take(const thenar_hand_codes *codes, uint16_t sensor, int32_t reading);
uint32_t take(const thenar_hand_codes *codes, uint16_t sensor, int32_t reading)
{
    uint16_t memory[THENAR_HAND_MEMORY];
    thenar hand;
    thenar_init(&hand, &thenar_hand_model, memory);
    thenar_hand_set_reading(&hand, codes, sensor, reading);
    %s
}
"""


class Codes:
    """The C of some sensors, begun."""

    def __init__(self, library: ctypes.CDLL, sensors: int) -> None:
        self.library, self.state = library, (ctypes.c_int32 * (16 * sensors))()  # more than a sensor's line takes
        library.thenar_hand_codes_init(self.state)
        library.thenar_hand_calibrate.restype = library.thenar_hand_calibrated.restype = ctypes.c_bool

    def sweep(self, sensor: int, readings: range = READINGS) -> list[int]:
        found = (ctypes.c_uint16 * len(readings))()
        self.library.sweep(self.state, sensor, readings.start, readings.stop, found)
        return list(found)

    def calibrate(self, sensor: int, first: int, second: int) -> bool:
        return bool(self.library.thenar_hand_calibrate(self.state, sensor, first, second))


@pytest.fixture
def compiled(shared_library: SharedLibrary) -> Callable[..., Codes]:
    """Return what compiles the codes of some names."""

    def compiled(
        names: Manifest, sensors: Sensors | None = None, take: str = "return 0u;", highest: int = 900
    ) -> Codes:
        layout = Layout(tables_of(names, highest))
        files = Library("hand", names, layout, glove=sensors).whole
        library = shared_library({**files, "sweep.c": SWEEP, "take.c": TAKE % take}, "-Wall", "-Wextra", "-Wconversion")
        return Codes(library, len((sensors or sensors_of(names)).every))

    return compiled


def tables_of(names: Manifest, highest: int) -> IntegerTables:
    random = np.random.default_rng(1)
    s, j, k = len(names.switches), len(names.joints), 3

    def rows(*shape: int) -> np.ndarray:
        return random.integers(-20, 21, shape).astype(np.int16)

    steps = np.array([7, highest], np.uint16)
    return IntegerTables.of(
        rows(k), rows(s, k), (steps,) * j, tuple(rows(3, k) for _ in range(j)), rows(s, k), rows(j, k), 100.0
    )


def names_of(joints: Sequence[Calibration], switches: Sequence[Switch] = ()) -> Manifest:
    zeros = [np.zeros(shape, np.int16) for shape in (3, (1, 3), (1, 3), (0, 3))]
    tables = IntegerTables.of(zeros[0], zeros[1], (), (), zeros[2], zeros[3], 1.0)
    return structs.replace(numbered(tables), joints=tuple(joints), switches=tuple(switches) or (Switch(0, "s0", 0.0),))


def joint(
    name: str, unit: str = "deg", points: tuple[int, float, int, float] = (0, -250.0, 1000, 250.0)
) -> Calibration:
    return Calibration(0, name, unit, *points)


def in_python(sensor: Sensor, first: int, second: int, readings: range = READINGS) -> list[int]:
    """What the runtime makes of readings, where a sensor read these two at its points."""
    line = CodeLine((first, sensor.codes[0]), (second, sensor.codes[1]))
    return [line.code(reading) for reading in readings]


def random_joint(random: np.random.Generator, number: int) -> Calibration:
    """Grids of all kinds: half degrees, of which many codes lie midway between two, and any others."""
    if number % 2:
        return joint(f"j{number}")
    low, high = np.sort(random.uniform(-300, 300, 2)).tolist()
    codes = random.choice(65536, 2, replace=False).tolist()
    return joint(f"j{number}", points=(codes[0], low, codes[1], high + 1.0))


@pytest.mark.parametrize("seed", range(4))
def test_readings_have_pythons_codes_by_any_calibration_set(compiled: Callable[..., Codes], seed: int) -> None:
    random = np.random.default_rng(seed)
    names = names_of([random_joint(random, number) for number in range(6)])
    sensors = sensors_of(names)
    codes = compiled(names)
    for number, sensor in enumerate(sensors.every):
        assert not codes.library.thenar_hand_calibrated(codes.state, number)
        assert set(codes.sweep(number, range(-9, 9))) == {0}
        spans = [1, 2, 60, 120, 254, 1023, 4095, FARTHEST]
        span = int(random.choice(spans))
        first = int(random.integers(-FARTHEST, FARTHEST + 1 - span))
        ends = (first, first + span) if random.integers(2) else (first + span, first)
        assert codes.calibrate(number, *ends)
        assert codes.sweep(number) == in_python(sensor, *ends)


# Readings at the points, and codes there: steep and flat lines, far codes, the longest spans; many codes midway between
# two, or next to it by the rounding of a point's code.
_NEXT = (6.6, 33.3, 66.6, 133.2)
HARD = [
    *(
        (0, 666, sign * delta, sign * round(code * 2**24) + delta)
        for code in _NEXT
        for sign in (1, -1)
        for delta in (0, 1)
    ),
    *(
        (begin, begin + span, 500 << 24, 680 << 24)
        for begin, span in ((-300, 600), (0, 360), (65_175, 360), (-65_535, 720))
    ),
    *(
        (0, 1, low, high)
        for low, high in ((-(2**44) + 1, 2**44 - 1), (2**44 - 1, -(2**44) + 1), (0, 2**23), (2**23, -1))
    ),
    *((-32_768, 32_767, low << 24, high << 24) for low, high in ((0, 65_535), (65_535, 0), (100, 101), (-9, 65_536))),
    *((0, FARTHEST, low, high) for low, high in ((0, 1), (1 << 24, (1 << 24) + 1), (-(2**44) + 1, 2**44 - 1), (5, -5))),
    (-1, FARTHEST - 1, (70_000 << 24) + 3, (70_001 << 24) - 3),
    (-7, 8, -(9 << 24), -(3 << 24)),
]


@pytest.mark.parametrize("turned", [False, pytest.param(True, marks=pytest.mark.slow)], ids=["forward", "backward"])
def test_readings_of_hard_lines_have_pythons_codes(compiled: Callable[..., Codes], turned: bool) -> None:
    lines = [(second, first, high, low) if turned else (first, second, low, high) for first, second, low, high in HARD]
    sensors = tuple(Sensor(f"j{n}", line[2:], ("a", "b"), line[:2]) for n, line in enumerate(lines))
    codes = compiled(names_of([joint(sensor.name) for sensor in sensors]), Sensors(sensors, (), ()))
    for number, (sensor, (first, second, *_)) in enumerate(zip(sensors, lines, strict=True)):
        assert codes.sweep(number) == in_python(sensor, first, second), lines[number]


@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_readings_of_any_line_have_pythons_codes(compiled: Callable[..., Codes], data: st.DataObject) -> None:
    code = (
        st.integers(-(2**44) + 1, 2**44 - 1) | st.integers(0, 2**16).map(lambda whole: whole << 24) | st.integers(-9, 9)
    )
    points = st.tuples(st.integers(-FARTHEST, FARTHEST), st.integers(1, FARTHEST), code, code)
    lines = data.draw(
        st.lists(points.filter(lambda p: p[0] + p[1] <= FARTHEST and p[2] != p[3]), min_size=1, max_size=8)
    )
    sensors = tuple(Sensor(f"j{n}", p[2:], ("a", "b"), (p[0], p[0] + p[1])) for n, p in enumerate(lines))
    codes = compiled(names_of([joint(sensor.name) for sensor in sensors]), Sensors(sensors, (), ()))
    for number, sensor in enumerate(sensors):
        assert sensor.readings is not None
        for begin in (sensor.readings[0] - 500, sensor.readings[1] - 500, -FARTHEST - 2, -500, FARTHEST - 998):
            readings = range(begin, begin + 1000)
            assert codes.sweep(number, readings) == in_python(sensor, *sensor.readings, readings), lines[number]


def test_what_makes_no_line_is_refused_and_changes_nothing(compiled: Callable[..., Codes]) -> None:
    codes = compiled(names_of([joint("index_mpj")]))
    assert codes.calibrate(0, 100, 300)
    before = list(codes.state)
    for sensor, first, second in (
        (0, 5, 5),
        (1, 0, 9),
        (0, -1, FARTHEST),
        (0, 0, FARTHEST + 1),
        (0, 2**31 - 1, -(2**31)),
    ):
        assert not codes.calibrate(sensor, first, second)
        assert list(codes.state) == before


def hand(random: np.random.Generator, names: Sequence[str]) -> GloveCalibration:
    lines = []
    for name in names:
        first, second = random.choice(np.arange(1, 256), 2, replace=False).tolist()
        lines.append(SensorCalibration(name, first, 0.0, second, float(random.choice([90.0, 100.0, 72.5, 33.3]))))
    return GloveCalibration(sensors=tuple(lines))


@pytest.mark.parametrize("seed", range(3))
def test_a_cyberglove_s_bytes_have_the_codes_that_a_run_gives_them(
    compiled: Callable[..., Codes], seed: int, tmp_path: Path
) -> None:
    random = np.random.default_rng(seed)
    joints = [random_joint(random, number) for number in range(8)]
    calibration = hand(random, [each.name for each in joints])
    names = names_of(joints)
    codes = compiled(names, sensors_of(names, calibrated_glove(tmp_path, calibration)))
    for number, each in enumerate(joints):
        assert codes.sweep(number, range(256)) == list(codes_of_bytes(each, calibration))


STREAM = """
name = "glove"
[[stream]]
port = "/dev/ttyUSB0"
columns = ["a", "b", "c", "pad"]
joints = { a = [800, 2800], b = [1023, 0], c = [-100, 154] }
taxels = { pad = [0, 1023] }
"""


def live_codes(
    harness: Harness, joints: Sequence[Calibration], calibration: GloveCalibration | None
) -> list[list[int]]:
    """What a run makes of the numbers of a stream: bytes, and of these, codes."""
    ranges = harness.streams[0].joints
    tables = CodeTables(joints, list(ranges), calibration or numbers_of(ranges))
    grids = [_Grid(limits, 1, 255) for limits in ranges.values()]
    found = []
    for number in READINGS:
        numbers = bytes(min(max(grid.code(float(number)), 1), 255) for grid in grids)
        found.append(list(tables.codes(numbers)[: len(joints)]))
    return [list(column) for column in zip(*found, strict=True)]


@pytest.mark.parametrize("case", ["raw", "numbers", "degrees"])
def test_a_stream_s_numbers_have_the_codes_that_a_run_gives_them(
    compiled: Callable[..., Codes], tmp_path: Path, case: str
) -> None:
    points = {"raw": (1, 1.0, 255, 255.0), "numbers": (0, -40.0, 1000, 960.0), "degrees": (0, -250.0, 1000, 250.0)}[
        case
    ]
    joints = [joint(name, {"raw": "raw", "numbers": "ohm", "degrees": "deg"}[case], points) for name in "cab"]
    calibration = hand(np.random.default_rng(2), "abc") if case == "degrees" else None
    harness = parse_harness(STREAM, "glove.toml")
    if calibration is not None:
        (tmp_path / "anna.toml").write_text(calibration.to_toml())
        (tmp_path / "glove.toml").write_text(STREAM.replace("joints =", 'calibration = "anna.toml"\njoints ='))
        harness = load_harness(tmp_path / "glove.toml")
    names = names_of(joints)
    sensors = sensors_of(names, harness)
    assert sensors.on_pins
    codes = compiled(names, sensors)
    assert [codes.sweep(number) for number in range(3)] == live_codes(harness, joints, calibration)
    # Calibrated anew on the board, the numbers are bytes first, as `thenar calibrate` takes them.
    assert codes.calibrate(0, 10, 60)
    grid = sensors.joints[0].grid
    assert grid is not None
    again = replace(sensors.joints[0], readings=(grid_code(grid, 10), grid_code(grid, 60)))
    assert codes.sweep(0) == [code_of(again, reading) for reading in READINGS]


@pytest.mark.parametrize("calibrated", [False, True], ids=["counts", "calibrated"])
def test_a_taxel_s_levels_close_as_a_run_closes_them(
    compiled: Callable[..., Codes], tmp_path: Path, calibrated: bool
) -> None:
    points = (130, 0.0, 700, 2.5) if calibrated else (0, 0.0, 1, 1.0)
    coded = Calibration(0, "pad", "N" if calibrated else "counts", *points)
    levels = [Threshold(code, 0.0, coded) for code in (90, 400, 1000)]
    switches = [Switch(0, "s0", 0.0), *(Switch(1, f"level {n}", 0.0, level) for n, level in enumerate(levels))]
    (tmp_path / "pads.toml").write_text(TaxelCalibration(unit="N", sensors=(pad_line("pad", 900, 222, 2.5),)).to_toml())
    settings = '[taxels]\ncalibration = "pads.toml"\n' if calibrated else ""
    (tmp_path / "glove.toml").write_text(STREAM + settings)
    harness = load_harness(tmp_path / "glove.toml")
    names = names_of([joint("a", "raw", (1, 1.0, 255, 255.0))], switches)
    sensors = sensors_of(names, harness)
    codes = compiled(names, sensors, take="return hand.switches[0];")
    lines = TaxelCalibration(unit="N", sensors=(pad_line("pad", 900, 222, 2.5),)) if calibrated else None
    grid = _Grid((0, 1023), 0, steps_of((0, 1023)))
    for reading in range(-3, 1030):
        count = min(max(grid.code(reading), 0), 1023)
        limits = [count_limit(level, lines) for level in levels]
        closed = [(count if limit >= 0 else ~count) > limit for limit in limits]
        assert codes.library.take(codes.state, 1, reading) == sum(2 << n for n, each in enumerate(closed) if each)
    assert codes.library.take(codes.state, 0, 900) == 0  # another sensor closes nothing


def test_a_reading_goes_into_the_input(compiled: Callable[..., Codes]) -> None:
    names = names_of([joint("a"), joint("b")])
    codes = compiled(names, take="return hand.codes[1];", highest=254)
    assert codes.calibrate(1, 0, 100)  # 0 and 90 degrees: codes 500 and 680
    assert codes.library.take(codes.state, 1, 0) == 500
    assert codes.library.take(codes.state, 1, -200) == 140
    assert codes.library.take(codes.state, 0, 7) == 0


def test_what_a_glove_does_not_know_is_said() -> None:
    harness = parse_harness(STREAM, "glove.toml")
    with pytest.raises(SettingError, match="no sensor of that name"):
        sensors_of(names_of([joint("d", "ohm")]), harness)
    fine = parse_harness(STREAM.replace("[800, 2800]", "[0.0, 3.3]"), "glove.toml")
    with pytest.raises(FirmwareError, match=r"range of 'a' in glove.toml, 0 to 3.3, must be whole numbers"):
        sensors_of(names_of([joint("a", "raw", (1, 1.0, 255, 255.0))]), fine)
    with pytest.raises(SettingError, match="not in the glove's bytes"):
        sensors_of(names_of([joint("index_mpj")]), parse_harness('name = "g"\n[cyberglove]\nport = "x"\n', "g"))


def test_a_build_of_switches_alone_has_no_codes() -> None:
    names = names_of([])
    whole = Library("hand", names, Layout(tables_of(names, 9))).whole
    assert not [path for path in whole if "codes" in path]


def test_points_of_degrees_are_poses_unless_codes_are_too_fine() -> None:
    sensors = sensors_of(names_of([joint("index_mpj"), joint("mine"), joint("fine", points=(0, 0.0, 60000, 0.6))]))
    assert [sensor.says for sensor in sensors.joints] == [
        ("0 deg", "90 deg"),
        ("0 deg", "90 deg"),
        ("0 deg", "0.6 deg"),
    ]
