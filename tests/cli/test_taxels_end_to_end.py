"""Pads with levels from a set to recognition: compiled for a board, emulated, recognised, recorded, imported."""

import json
import sys
from bisect import bisect
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler import GraspSet
from thenar.compiler.recordings.graspset import Joint
from thenar.runtime.frames import SwitchFrame
from thenar.runtime.recording.reader import Reader

from ..conftest import tool
from ..sets import grasp_set_of
from .conftest import thenar, works

# In real time, over a pty.
pytestmark = pytest.mark.slow

ROWS, CODES = 60, {"cup": (800, 100, 400), "pen": (100, 820, 380), "rod": (420, 430, 60)}
_BUS = """
[[bus]]
device = "/dev/i2c-7"
clock_hz = 400_000
[[bus.chip]]
kind = "mcp23017"
address = 0x20
pins = { GPB1 = "s0" }
"""
GLOVES = {
    "board": """
[[stream]]
port = "/dev/ttyACM0"
rate_hz = 200
switches = ["s0"]
taxels = { p0 = [0, 1023], p1 = [0, 1023], p2 = [0, 1023] }
[stream.board]
pins = { s0 = "2", p0 = "A0", p1 = "A1", p2 = "A2" }
""",
    "i2c": f"""{_BUS}
[[bus.chip]]
kind = "ads1115"
address = 0x48
pins = {{ AIN1 = "p0" }}
[[bus.chip]]
kind = "ads7828"
address = 0x49
mux = {{ address = 0x70, channel = 2 }}
pins = {{ CH6 = "p2", CH3 = "p1" }}
""",
    "spi and i2c": f"""{_BUS}
[[spi]]
device = "/dev/spidev0.1"
kind = "mcp3008"
pins = {{ CH7 = "p1", CH2 = "p2" }}
[[bus.chip]]
kind = "ads1115"
address = 0x4B
pins = {{ AIN3 = "p0" }}
""",
}


def pads(folder: Path) -> Path:
    names, random = list(CODES), np.random.default_rng(1)
    labels = np.arange(ROWS) % len(names)
    codes = np.array([CODES[name] for name in names])[labels] + random.integers(-25, 26, (ROWS, 3))
    grasp_set = grasp_set_of(
        names,
        labels,
        switches=random.random((ROWS, 1)) < 0.5,
        taxels=codes.astype(np.uint16),
        taxel_columns=tuple(Joint(f"p{number}", "N", 20, 0.0, 820, 4.0) for number in range(3)),
    )
    grasp_set.save(folder / "set.grasps")
    return folder / "set.grasps"


@pytest.mark.parametrize("wiring", GLOVES)
def test_a_glove_of_pads_recognises_by_their_levels(tmp_path: Path, wiring: str) -> None:
    if wiring != "board":
        tool("umockdev-wrapper")
    grasps, glove, build = pads(tmp_path), tmp_path / "glove.toml", tmp_path / "build"
    glove.write_text(GLOVES[wiring])
    works("compile", grasps, "-o", build, "--rounds", "10", "--folds", "0", "--glove", glove, "--no-report")
    record, log = tmp_path / "run.mcap", tmp_path / "log.jsonl"
    run = ("run", build, "--glove", "{glove}", "--frames", "800", "--record", record)
    emulate = ("emulate", grasps, "--glove", glove, "--dir", tmp_path / "emulated", "--period-ms", "100", "--log", log)
    done = works(*emulate, "--", sys.executable, "-m", "thenar.cli", *run)
    shown = [json.loads(line) for line in log.read_text().splitlines()]
    starts = [frame["time_us"] for frame in shown]
    judged = 0
    for grasp in map(json.loads, done.stdout.splitlines()):
        at = bisect(starts, grasp["time_us"]) - 1
        if at >= 0 and 50_000 < grasp["time_us"] - starts[at] < 100_000 and grasp["health"] != "unknown":
            assert grasp["candidate"] == shown[at]["grasp"]
            judged += 1
    assert judged > 50
    coded = [entry.taxels for entry in Reader(record) if isinstance(entry, SwitchFrame) and entry.taxels is not None]
    assert len(coded) > 100
    works("run", build, "--replay", record)


def test_doctor_finds_converters_and_what_is_wrong_with_them(tmp_path: Path) -> None:
    tool("umockdev-wrapper")
    grasps, glove, own = pads(tmp_path), tmp_path / "glove.toml", tmp_path / "own.toml"
    glove.write_text(GLOVES["spi and i2c"])
    # A converter more than there is: its address acknowledges nothing.
    own.write_text(GLOVES["spi and i2c"] + '[[bus.chip]]\nkind = "ads7828"\naddress = 0x48\npins = { CH0 = "gone" }\n')
    doctor = (sys.executable, "-m", "thenar.cli", "doctor", own, "--json")
    emulate = ("emulate", grasps, "--glove", glove, "--dir", tmp_path / "emulated", "--period-ms", "20000")
    done = thenar(*emulate, "--", *doctor)
    assert done.returncode == 1, done.stderr
    found = {(one["device"][:3], one["part"]): one for one in json.loads(done.stdout)}
    there = [("spi", "mcp3008"), ("i2c", "taxel p0"), ("spi", "taxel p1"), ("spi", "taxel p2")]
    assert [found[key]["present"] for key in there] == [True] * 4
    (bus,) = (one for (device, part), one in found.items() if device == "i2c" and not part.startswith("taxel"))
    assert "the ads7828 at 0x48 does not reply" in bus["remarks"][0]
    assert found["i2c", "taxel gone"]["remarks"] == ["silent"]
    assert not found["i2c", "taxel gone"]["present"]
    codes = GraspSet.load(grasps).taxels[0]
    for key, code in zip(there[1:], codes, strict=True):
        assert found[key]["remarks"][0].startswith(f"{code} counts, noise 0.0")
    assert bus["predicted_us"] > 96.3 + 1317 + 121.3
    assert found["spi", "mcp3008"]["predicted_us"] == pytest.approx(2 * (24 / 1.35 + 0.5))
