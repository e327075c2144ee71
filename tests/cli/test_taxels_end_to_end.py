"""Pads with levels from a set to recognition: compiled for a board, emulated, recognised, recorded, imported."""

import json
import sys
from bisect import bisect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thenar.compiler import GraspSet
from thenar.compiler.recordings.graspset import Joint
from thenar.compiler.recordings.taxonomy import own
from thenar.runtime.frames import SwitchFrame
from thenar.runtime.recording.reader import Reader

# In real time, over a pty.
pytestmark = pytest.mark.slow

Thenar = Callable[..., Any]
ROWS, CODES = 60, {"cup": (800, 100, 400), "pen": (100, 820, 380), "rod": (420, 430, 60)}
GLOVE = '[[scanner]]\nport = "/dev/ttyACM0"\nswitches = ["s0"]\ntaxels = ["p0", "", "p1", "p2"]\n'


def pads(folder: Path) -> Path:
    names, random = list(CODES), np.random.default_rng(1)
    labels = np.arange(ROWS) % len(names)
    codes = np.array([CODES[name] for name in names])[labels] + random.integers(-25, 26, (ROWS, 3))
    grasp_set = GraspSet(
        switches=random.random((ROWS, 1)) < 0.5,
        switch_names=("s0",),
        codes=np.zeros((ROWS, 0), np.uint16),
        joints=(),
        grasps=np.array(names)[labels],
        taxonomy=own(names),
        subjects=np.full(ROWS, "A"),
        objects=np.full(ROWS, "thing"),
        trials=np.arange(ROWS),
        taxels=codes.astype(np.uint16),
        taxel_columns=tuple(Joint(f"p{number}", "N", 20, 0.0, 820, 4.0) for number in range(3)),
    )
    grasp_set.save(folder / "set.grasps")
    return folder / "set.grasps"


def test_a_glove_of_pads_recognises_by_their_levels(thenar: Thenar, tmp_path: Path) -> None:
    grasps, glove, build = pads(tmp_path), tmp_path / "glove.toml", tmp_path / "build"
    glove.write_text(GLOVE)
    done = thenar("compile", grasps, "-o", build, "--rounds", "10", "--folds", "0", "--glove", glove, "--no-report")
    assert done.returncode == 0, done.stderr
    record, log = tmp_path / "run.mcap", tmp_path / "log.jsonl"
    run = ("run", build, "--glove", "{glove}", "--frames", "800", "--record", record)
    emulate = ("emulate", grasps, "--glove", glove, "--dir", tmp_path / "emulated", "--period-ms", "100", "--log", log)
    done = thenar(*emulate, "--", sys.executable, "-m", "thenar.cli", *run)
    assert done.returncode == 0, done.stderr
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
    done = thenar("run", build, "--replay", record)
    assert done.returncode == 0, done.stderr
