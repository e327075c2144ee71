"""The classifier as a module of MicroPython: every score, margin and probability is Python's, whatever the tables."""

import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec import structs

from thenar.compiler.firmware.classifier import LAG_US, Library
from thenar.compiler.firmware.layout import Layout
from thenar.compiler.firmware.probes import Predictions, Probes, lost_inputs
from thenar.compiler.firmware.sensors import Sensor, sensors_of
from thenar.compiler.firmware.softmax import Softmax
from thenar.compiler.firmware.targets import TARGETS
from thenar.runtime.build import Build
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.manifest import Calibration, Manifest, Rejection, Threshold
from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.model.terms.grid import Grid
from thenar.runtime.model.terms.line import Line
from thenar.runtime.segmenting.decoder import Decoder
from thenar.runtime.segmenting.model import SegmentModel

from ....conftest import tool
from ....tables import code_of, describe, grid_code
from ..conftest import make_tables, probed, same_as_python

TARGET = TARGETS["micropython"]
SHAPES: dict[str, dict[str, int]] = {
    "small": {"classes": 7, "switches": 12, "joints": 4},
    "switches_only": {"joints": 0},
    "joints_only_wide_codes": {"switches": 0, "highest": 4095},
    "wide_codes_after_an_odd_byte": {"switches": 11, "highest": 65535},
    "more_than_256_classes": {"classes": 261, "reach": 3},
    "many_bins": {"bins": 40},
}


@pytest.fixture(autouse=True)
def interpreter() -> None:
    if missing := TARGET.missing():
        tool(missing.split()[0])


def answers(layout: Layout, manifest: Manifest, frames: Probes, **how: Any) -> Predictions:
    sent = layout.frame_bytes(frames.bits, frames.codes)
    return TARGET.run(TARGET.sources(Library("hand", manifest, layout)), "hand", layout, sent, **how)


def test_every_score_is_python_s_with_inputs_missing_too() -> None:
    tables = make_tables(**SHAPES["small"])
    frames = probed(tables, 500)
    for lost in (None, lost_inputs(tables, len(frames), 3)):
        found = answers(Layout(tables), describe(tables), frames, lost=lost)
        same_as_python(found, tables, frames, lost)
        assert found.names == describe(tables).grasps


def with_slopes(tables: IntegerTables) -> IntegerTables:
    row = np.arange(-3, tables.n_classes - 3, dtype=np.int8)
    return tables.changed(further=(Line(1, 20, 220, row, 0), Line(2, 3, 50, -row, 2), Line(3, 9, 250, row, -3)))


def with_pairs(tables: IntegerTables) -> IntegerTables:
    steps = np.array([9, 40, 254], np.uint16), np.array([77], np.uint16)
    random = np.random.default_rng(3)
    rows = [random.integers(-20, 21, (4, 2, tables.n_classes)).astype(np.int16) for _ in range(2)]
    return tables.changed(further=(Grid((0, 3), steps, rows[0]), Grid((1, 2), steps, rows[1])))


@pytest.mark.slow
@pytest.mark.parametrize("lost", [False, True], ids=["whole", "missing"])
@pytest.mark.parametrize("shape", [*list(SHAPES)[1:], "slopes", "pairs"])
def test_so_it_is_for_tables_of_any_shape(shape: str, lost: bool) -> None:
    tables = make_tables(**SHAPES.get(shape, SHAPES["small"]))
    tables = {"slopes": with_slopes, "pairs": with_pairs}.get(shape, lambda same: same)(tables)
    frames = probed(tables, 60)
    gone = lost_inputs(tables, len(frames), 3) if lost else None
    found = answers(Layout(tables), describe(tables), frames, lost=gone)
    same_as_python(found, tables, frames, gone)


MORE = """
import thenar_hand as library
glove = library.Glove()
for number in range(0, {switches}, 3):
    glove.set_switch(number, True)
for joint in range({joints}):
    glove.set_code(joint, 40 * joint)
grasp = glove.classify()
print(glove.margin(), *[glove.probability(k) for k in range({classes})], glove.decide(grasp))
glove.lose_switch(1, True)
print(glove.decide(grasp))
print(library.NONE, library.NAMES[library.NONE])
"""


def printed(files: Mapping[str, str], program: str, folder: Path) -> str:
    """Return what a program around the classifier prints."""
    for path, text in {**files, "main.py": program}.items():
        (folder / path).write_text(text)
    command = [sys.executable, "-m", "micropython_unix", "main.py"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_margin_probability_and_refusal_are_python_s(tmp_path: Path) -> None:
    tables = make_tables(**SHAPES["small"])
    bits = np.arange(tables.n_switches)[np.newaxis] % 3 == 0
    codes = 40 * np.arange(tables.n_joints, dtype=np.uint16)[np.newaxis]
    layout = Layout(tables)
    scores = tables.scores(bits, codes)[0]
    best = int(scores.argmax())
    k, j = tables.n_classes, tables.n_joints
    least = [32767 if each == best else -32768 for each in range(k)]  # refused for its score alone
    rejection = Rejection(0.05, tuple(least), ((0, 12),) * k, (((0, 65535),) * j,) * k, 0)
    manifest = structs.replace(describe(tables), rejection=rejection)
    files = TARGET.sources(Library("hand", manifest, layout))
    program = MORE.format(switches=tables.n_switches, joints=j, classes=k)
    said, with_a_switch_lost, of_none = printed(files, program, tmp_path).splitlines()
    margin, *shares = map(int, said.split())
    assert margin == scores.max() - np.sort(scores)[-2]
    assert shares == [*Softmax(tables.scale).probabilities(scores.tolist()), k]
    assert int(with_a_switch_lost) == best
    assert of_none == f"{k} none"


# The state at every tick; each third of the stream begins afresh.
FOLLOWING = """
import thenar_hand as library
glove, segmenter = library.Glove(), library.Segmenter()
print(library.TICK_US, library.LAG_TICKS, library.NAMES[library.SEGMENT_NONE])
for tick in range({ticks}):
    if tick % {stream} == 0:
        segmenter.start()
    for number in range({switches}):
        glove.set_switch(number, number % 5 == tick // {still} % 5)
    print(segmenter.push(glove, glove.classify()))
"""


def test_a_segmenter_begins_afresh(tmp_path: Path) -> None:
    tables = make_tables(**SHAPES["small"])
    model = structs.replace(SegmentModel.usual(tables.n_classes, False, tables.scale / 8), enter=(40,) * 7)
    manifest = structs.replace(describe(tables), segments=model)
    ticks, stream, still = 480, 160, 17
    files = TARGET.sources(Library("hand", manifest, Layout(tables)))
    program = FOLLOWING.format(ticks=ticks, stream=stream, still=still, switches=tables.n_switches)
    first, *lines = printed(files, program, tmp_path).splitlines()
    assert first == f"{model.tick_us} {LAG_US // model.tick_us} none"
    build, expected = Build(manifest, tables), []
    for tick in range(ticks):
        if tick % stream == 0:
            decoder = Decoder(model, LAG_US // model.tick_us)
        bits = np.arange(tables.n_switches) % 5 == tick // still % 5
        found = decoder.push(build.scores(bits, np.zeros(tables.n_joints, np.uint16)).tolist())
        expected.append(str(found.state))
    assert lines == expected
    assert len(set(expected)) > 3


CONVERTING = """
import thenar_hand as library
glove = library.Glove()
print(*[glove.calibrated(sensor) + 0 for sensor in range({sensors})])
for again in range(2):
    for sensor in range({sensors}):
        print(*[glove.code_of(sensor, reading) for reading in range({first}, {last})])
    for sensor in range({sensors}):
        print(glove.calibrate(sensor, 900, 100 + sensor) + 0, glove.calibrate(sensor, 7, 7) + 0)
for sensor in range({sensors}):
    glove.set_reading(sensor, 300 + 60 * sensor)
glove.classify()
print(*[glove.score(k) for k in range({classes})])
"""
STREAM = """
name = "glove"
[[stream]]
port = "/dev/ttyUSB0"
joints = { j0 = [800, 100], j1 = [0, 1016], j2 = [-30, 500], j3 = [200, 454] }
taxels = { pad = [0, 1023] }
"""


@pytest.mark.parametrize("known", [True, False], ids=["of a glove", "not known"])
def test_readings_become_python_s_codes(tmp_path: Path, known: bool) -> None:
    tables = make_tables(**SHAPES["small"])
    manifest = describe(tables)
    levels = [Threshold(code, 0.0, Calibration(0, "pad", "counts", 0, 0.0, 1, 1.0)) for code in (90, 400)]
    low, high = (structs.replace(manifest.switches[n], threshold=level) for n, level in enumerate(levels))
    joints = manifest.joints  # 0 to 1016 ohm: many codes midway between two
    if known:
        joints = tuple(structs.replace(joint, unit="ohm", code_a=0, code_b=508, value_b=1016.0) for joint in joints)
    manifest = structs.replace(manifest, switches=(low, high, *manifest.switches[2:]), joints=joints)
    sensors = sensors_of(manifest, parse_harness(STREAM, "glove.toml") if known else None)
    library = Library("hand", manifest, Layout(tables), glove=sensors)
    readings = range(-90, 1100)
    count = len(sensors.every)
    given = {"sensors": count, "classes": tables.n_classes, "first": readings.start, "last": readings.stop}
    text = printed(TARGET.sources(library), CONVERTING.format(**given), tmp_path)
    lines = [[int(word) for word in line.split()] for line in text.splitlines()]

    def codes(every: Sequence[Sensor]) -> list[list[int]]:
        return [[0 if each.readings is None else code_of(each, reading) for reading in readings] for each in every]

    again = []
    for n, each in enumerate(sensors.every):
        first, second = (grid_code(each.grid, count) if each.grid else count for count in (900, 100 + n))
        again.append(replace(each, readings=(first, second)))
    answers = [[int(one.readings[0] != one.readings[1]), 0] for one in again if one.readings]
    assert lines[0] == [int(known)] * count
    assert lines[1:-1] == [*codes(sensors.every), *answers, *codes(again), *answers]
    found = [code_of(each, 300 + 60 * n) for n, each in enumerate(again)]
    bits = np.zeros(tables.n_switches, bool)
    bits[:2] = found[-1] > 90, found[-1] > 400
    held = np.array(found[:-1], np.uint16)
    assert lines[-1] == Build(manifest, tables).scores(bits, held).tolist()
