"""From a build to its wearer's in one command, on emulated devices, without the packages of the extras."""

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.typing import NDArray

from thenar.compiler import GraspSet, compile_build
from thenar.compiler.recordings.graspset import Joint
from thenar.drivers.calibration import GloveCalibration, SensorCalibration
from thenar.drivers.cyberglove_protocol import SENSORS_18
from thenar.drivers.emulated.cyberglove import EmulatedCyberGlove
from thenar.drivers.emulated.lines import BoardSender
from thenar.drivers.emulated.serial_line import PtyLine
from thenar.runtime.build import Build
from thenar.runtime.calibration import codes_of_bytes
from thenar.runtime.manifest import Calibration

from ..sets import grasp_set_of
from .conftest import refusal, thenar
from .test_adapt_command import BARE
from .test_record_command import GLOVE

pytestmark = pytest.mark.slow

TYPES, SWITCHES, JOINTS = ("cup", "pen", "rod"), ("s1", "s2", "s3"), ("index_mpj", "index_pij")
# A tenth of a degree a code, as no recording has by itself.
CODING = Calibration(0, "", "deg", 0, -20.0, 1000, 80.0)
LINES = tuple(SensorCalibration(name, 40, 0.0, 200, 100.0) for name in SENSORS_18)
# What the wearer's hand does for each type: others bend the index finger less.
CLOSED = {"cup": ("s1", "s3"), "pen": ("s2", "s3"), "rod": ("s2", "s3"), "fist": ("s1",)}
BENT = {"cup": (60, 90), "pen": (150, 100), "rod": (170, 160), "fist": (60, 200)}
PROMPT = re.compile(r"(\d+) of \d+: (cup|pen|rod|fist), ")


def live_codes(raw: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the codes of bytes (n, 2) that the build gets from the calibrated glove."""
    tables = [codes_of_bytes(replace(CODING, name=name), GloveCalibration(sensors=LINES)) for name in JOINTS]
    columns = zip(tables, np.clip(raw, 1, 255).T, strict=True)
    return np.column_stack([np.array(table)[column] for table, column in columns])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    random, labels = np.random.default_rng(3), np.arange(90) % 3
    bent = np.array([BENT[name] for name in TYPES]) - [[0, 0], [30, 0], [50, 40]]
    closed = np.array([[name in CLOSED[grasp] for name in SWITCHES] for grasp in TYPES])
    crowd = grasp_set_of(
        TYPES,
        labels,
        switches=closed[labels] ^ (random.random((90, 3)) < 0.1),
        switch_names=SWITCHES,
        codes=live_codes(bent[labels] + random.integers(-15, 16, (90, 2))),
        joints=tuple(Joint(name, "deg", 0, -20.0, 1000, 80.0) for name in JOINTS),
    )
    compile_build(crowd, tmp_path / "build", trainer="linear", folds=0, jobs=1)
    calibrated = GLOVE.replace('/glove"', '/glove"\ncalibration = "hand.toml"')
    (tmp_path / "glove.toml").write_text(calibrated.format(folder=tmp_path))
    (tmp_path / "hand.toml").write_text(GloveCalibration(sensors=LINES).to_toml())
    return tmp_path


@pytest.fixture
def board(folder: Path) -> Iterator[BoardSender]:
    with PtyLine(folder / "board") as line, BoardSender(line.send, SWITCHES, (), 200) as board:
        yield board


@pytest.fixture
def glove(folder: Path) -> Iterator[EmulatedCyberGlove]:
    with PtyLine(folder / "glove") as line, EmulatedCyberGlove(line) as glove:
        yield glove


def worn(
    folder: Path, board: BoardSender, glove: EmulatedCyberGlove, leave_at: int = 99, *more: str
) -> tuple[int, str, str, str]:
    """Do what the prompts ask for, or leave; return the exit code, stdout, stderr and the last grasp."""
    command = [sys.executable, "-c", BARE, "wear", str(folder / "build"), "--glove", str(folder / "glove.toml")]
    command += ["--countdown", "0.3", "--frames", "200", "-o", str(folder / "mine"), *more]
    said, last = [], ""
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stderr is not None
        for line in map(bytes.decode, process.stderr):
            said.append(line)
            if (prompt := PROMPT.match(line)) is not None:
                last = prompt[2]
                board.show({name: float(name in CLOSED[last]) for name in SWITCHES})
                glove.set(bytes((100,) * 4 + BENT[last] + (100,) * 12))
            if "Enter: " in line:
                process.stdin.write(b"q\n" if prompt is not None and int(prompt[1]) == leave_at else b"\n")
                process.stdin.flush()
        out = process.stdout.read().decode()
        return process.wait(60), out, "".join(said), last


def test_one_command_fits_a_build_to_the_wearer(folder: Path, board: BoardSender, glove: EmulatedCyberGlove) -> None:
    before = {path.name: path.read_bytes() for path in (folder / "build").iterdir() if path.is_file()}
    code, out, said, last = worn(folder, board, glove)
    assert code == 0, said
    mine = GraspSet.load(folder / "mine.grasps")
    assert sorted(mine.grasps.tolist()) == sorted(2 * TYPES)
    bent = live_codes(np.array([BENT[grasp] for grasp in mine.grasps.tolist()]))
    assert mine.codes[:, 4:6].tolist() == bent.tolist()
    for grasp, closed in zip(mine.grasps.tolist(), mine.switches, strict=True):
        assert {name for name, bit in zip(SWITCHES, closed, strict=True) if bit} == set(CLOSED[grasp])
    build = Build.load(folder / "mine")
    assert build.manifest.adapted is not None
    assert build.manifest.adapted.counts == (2, 2, 2)
    assert "6 of 6 trials" in out
    assert json.loads(out.splitlines()[-1])["candidate"] == last
    assert before == {path.name: path.read_bytes() for path in (folder / "build").iterdir() if path.is_file()}

    tables = (folder / "mine" / "tables.bin").read_bytes()
    code, _, said, last = worn(folder, board, glove)
    assert code == 0, said
    assert not last  # all trials are there already
    assert (folder / "mine" / "tables.bin").read_bytes() == tables


def test_whoever_leaves_goes_on_later(folder: Path, board: BoardSender, glove: EmulatedCyberGlove) -> None:
    code, _, said, _ = worn(folder, board, glove, leave_at=3)
    assert code == 2
    assert "2 of 6 trials are done: the same command goes on" in said
    assert not (folder / "mine").exists()
    code, _, said, _ = worn(folder, board, glove)
    assert code == 0, said
    assert len(GraspSet.load(folder / "mine.grasps")) == 6


def test_a_type_that_nobody_else_has_is_taught(folder: Path, board: BoardSender, glove: EmulatedCyberGlove) -> None:
    code, out, said, last = worn(folder, board, glove, 99, "--add-type", "fist")
    assert code == 0, said
    mine = GraspSet.load(folder / "mine.grasps")
    assert sorted(mine.grasps.tolist()) == sorted(3 * (*TYPES, "fist"))
    assert Build.load(folder / "mine").grasps == (*TYPES, "fist")
    assert re.search("accuracy of the integers.*, 12 of 12 trials", out)
    assert json.loads(out.splitlines()[-1])["candidate"] == last


@pytest.mark.parametrize(
    ("pattern", "other", "said"), [('"s3"', '"s4"', "s3"), (r"\[cyberglove\][^[]*", "", "reads the build's joints")]
)
def test_a_glove_that_does_not_fit_is_refused_before_any_trial(
    folder: Path, pattern: str, other: str, said: str
) -> None:
    whole = re.sub(pattern, other, (folder / "glove.toml").read_text())
    (folder / "glove.toml").write_text(whole)
    done = thenar("wear", folder / "build", "--glove", folder / "glove.toml", "-o", folder / "mine")
    assert done.returncode == 2
    assert said in done.stderr
    assert not list(folder.glob("mine*"))


def test_a_folder_of_other_files_is_refused_before_any_trial(folder: Path) -> None:
    assert "is not empty and not a build" in refusal(
        "wear", folder / "build", "--glove", folder / "glove.toml", "-o", folder
    )
    assert not Path(f"{folder}.mcap").exists()
