"""`thenar teach`: a task from recorded demonstrations."""

import json
from collections.abc import Container, Sequence
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler import GraspSet, Joint, compile_build
from thenar.runtime import Build
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.live.system import LiveSystem
from thenar.runtime.recording.session import Session
from thenar.runtime.recording.writer import Recorder

from ..sets import grasp_set_of
from .conftest import refusal, thenar, works

TYPES = ("cup", "pen", "rod")
GLOVE = """
[cyberglove]
port = "/dev/ttyUSB0"
sensors = 18
joints = ["bend", "b", "c", "d", "e", "f", "g", "h", "i", "j", "k", "l", "m", "n", "o", "p", "q", "r"]
[[stream]]
port = "/dev/ttyACM0"
switches = ["s0", "s1", "s2"]
"""
GRIPPER = """
name = "Gripper"
time_from_start_s = 0.5
[[joints]]
name = "finger"
unit = "rad"
range = [0, 1]
[[preshapes]]
name = "wide"
positions = [0]
grasps = ["cup", "rod"]
[[preshapes]]
name = "narrow"
positions = [1]
grasps = ["pen"]
"""


def readings(label: int) -> tuple[int, int]:
    """Return the switches that are closed, and the joint's byte, where a type, or nothing (3), is held."""
    return (1 << label, 60 + 50 * label) if label < len(TYPES) else (0, 20)


def states(types: str, held: int = 40) -> list[int]:
    """Return what is held frame by frame, "c", "p" and "r" one after another, with nothing in between."""
    return [3] * 30 + [each for letter in types for each in ["cpr".index(letter)] * held + [3] * 30]


def grasps_of(labels: np.ndarray) -> GraspSet:
    """Return a set of frames, 10 ms apart, in which this is held."""
    read = np.array([readings(label) for label in labels.tolist()])
    starts = np.flatnonzero(np.diff(labels, prepend=-1))
    return grasp_set_of(
        TYPES,
        labels,
        switches=read[:, :1] >> np.arange(3) & 1,
        codes=read[:, 1:],
        joints=(Joint("bend", "deg", 1, 0.5, 255, 127.5),),
        trials=np.searchsorted(starts, np.arange(len(labels)), side="right") // 2,
        times_us=10_000 * np.arange(len(labels)),
    )


@pytest.fixture(scope="module")
def build(tmp_path_factory: pytest.TempPathFactory) -> Path:
    grasp_set = grasps_of(np.array(states("cprrpcpcr" * 2)))
    folder = tmp_path_factory.mktemp("taught") / "build"
    return compile_build(grasp_set, folder, rounds=10, folds=0).folder


def record(
    folder: Path, path: Path, held: list[int], clock_us: Sequence[int] = (), unread: Container[int] = ()
) -> Path:
    """Record a live run in which this is held, 10 ms a frame, on another clock or with frames that cannot be read."""
    build = Build.load(folder)
    system = LiveSystem.of(build, parse_harness(GLOVE, "glove.toml"))
    session = Session(
        thenar="0",
        switches=system.switch_names,
        sensors=system.sensor_names,
        harness=GLOVE,
        build=build.manifest.checksum,
    )
    recognizer, kept = system.recognizer(), [switch.column for switch in build.manifest.switches]
    with Recorder(path, session) as recorder:
        for number, label in enumerate(held):
            time_us, (closed, code) = 10_000 * number, readings(label)
            glove = GloveFrame(time_us, bytes([code]) + bytes(17), 3)
            bits = sum(1 << bit for bit, column in enumerate(kept) if closed >> column & 1)
            switches = SwitchFrame(time_us, bits, (1 << len(kept)) - 1 if number in unread else 0)
            recorder.frame(switches)
            if number not in unread:
                recorder.frame(glove)
            unix_us = clock_us[number] if clock_us else time_us + 1
            recorder.moment((), recognizer.step(time_us + 1, unix_us, switches, glove).grasp)
    return path


@pytest.fixture
def demos(build: Path, tmp_path: Path) -> list[Path]:
    every = enumerate(("cpr", "cpr", "crpr"), 1)
    return [record(build, tmp_path / f"demo{number}.mcap", states(types)) for number, types in every]


def test_demonstrations_have_their_steps_in_common(build: Path, demos: list[Path], tmp_path: Path) -> None:
    (tmp_path / "gripper.toml").write_text(GRIPPER)
    task = tmp_path / "task.json"
    done = works("teach", *demos, "-b", build, "-o", task, "--preshape", tmp_path / "gripper.toml")
    assert "3 steps of 3 demonstrations" in done.stdout
    found = json.loads(task.read_bytes())
    assert [(step["grasp"], step["preshape"]) for step in found["steps"]] == [
        ("cup", "wide"),
        ("pen", "narrow"),
        ("rod", "wide"),
    ]
    assert [step["joints"]["bend"] for step in found["steps"]] == [30.0, 55.0, 80.0]
    assert all(0.35 <= step["median_s"] <= 0.45 for step in found["steps"])
    assert [step["then"] for step in found["steps"]] == [["pen", "rod"], ["rod"], []]
    assert (tmp_path / "task.xml").read_bytes().count(b'<Action ID="Grasp" name=') == 3
    assert thenar("segment", demos[0], "-b", build, "--transitions", tmp_path / "graph.json").returncode == 0
    graph = json.loads((tmp_path / "graph.json").read_bytes())
    assert (graph["types"], graph["counts"]) == (list(TYPES), [[0, 1, 0], [0, 0, 1], [0, 0, 0]])
    works("teach", demos[2], "-b", build, "-o", tmp_path / "two.json", "--transitions", tmp_path / "graph.json")
    assert [step["then"] for step in json.loads((tmp_path / "two.json").read_bytes())["steps"]] == [
        ["rod", "pen"],
        ["pen"],
        ["rod"],
        [],
    ]


def test_a_replayed_recording_takes_preshapes(build: Path, demos: list[Path], tmp_path: Path) -> None:
    (tmp_path / "gripper.toml").write_text(GRIPPER)
    done = works("run", build, "--replay", demos[0], "--preshape", tmp_path / "gripper.toml", "--frames", 60)
    assert "60 of 60 frames recognised as they were recorded" in done.stderr
    shapes = [json.loads(line)["preshape"] for line in done.stdout.splitlines()]
    assert {shape["name"] for shape in shapes if shape} == {"wide"}
    assert len(shapes) == 60


def test_what_teaches_nothing_is_refused(build: Path, set_file: Path, tmp_path: Path) -> None:
    empty = record(build, tmp_path / "empty.mcap", [3] * 80)
    grasps_of(np.array([0])).save(static := tmp_path / "static.grasps")
    task = ("-b", build, "-o", tmp_path / "task.json")
    for asked, reason in (
        (("teach", empty, *task), "empty.mcap shows no grasp"),
        (("teach", static, *task), "each row of the set is a separate trial"),
        (("teach", set_file, *task), "the recordings lack 1 input of the build: bend"),
    ):
        assert reason in refusal(*asked)
    (tmp_path / "task.xml").write_text("mine")
    done = thenar("teach", empty, *task)
    assert "task.xml already exists" in done.stderr
    assert not (tmp_path / "task.json").exists()


@pytest.mark.parametrize("lag", [(), ("--lag-ms", "150")])
def test_a_recorded_run_is_cut_into_its_grasps(
    build: Path, demos: list[Path], tmp_path: Path, lag: tuple[str, ...]
) -> None:
    done = works("segment", demos[0], "-b", build, "-o", tmp_path / "s.csv", "--json", *lag)
    found = json.loads(done.stdout)
    assert [one["type"] for one in found["segments"]] == ["cup", "pen", "rod"]
    assert (found["streams"], found["f1"]) == (1, None)
    for number, one in enumerate(found["segments"]):
        assert one["start_s"] == pytest.approx(0.3 + 0.7 * number, abs=0.02)
        assert one["end_s"] == pytest.approx(0.7 + 0.7 * number, abs=0.02)
    assert len((tmp_path / "s.csv").read_text().splitlines()) == 4


_FRAMES = range(len(states("cpr")))


@pytest.mark.parametrize(
    ("clock_us", "unread"),
    [
        ([20_000 * (number // 2) for number in _FRAMES], ()),
        ([10_000 * (number ^ 1) for number in _FRAMES], ()),
        ([10_000 * number + 900_000 * (number > 45) for number in _FRAMES], ()),
        ([10_000 * number for number in _FRAMES], range(7, 999, 11)),
    ],
    ids=["repeats", "jitters", "jumps ahead", "unread frames"],
)
def test_the_clock_of_a_run_and_unread_frames_divide_no_grasp(
    build: Path, tmp_path: Path, clock_us: list[int], unread: Container[int]
) -> None:
    path = record(build, tmp_path / "run.mcap", states("cpr"), clock_us, unread)
    done = works("segment", path, "-b", build, "--json")
    found = json.loads(done.stdout)
    assert found["streams"] == 1
    assert [one["type"] for one in found["segments"]] == ["cup", "pen", "rod"]


def collected(path: Path, held: list[int], switches: tuple[str, ...], joint: str = "bend") -> Path:
    """Record what every device delivers, as no build reads it, 10 ms a frame, before and after the computer restarts.

    Switch i is switches[i]; what is called "s1" is what `readings` has as switch 1.
    """
    sensors = (*"bcdefghijklmnopq", joint, "r")
    session = Session(thenar="0", switches=switches, sensors=sensors, harness=GLOVE)
    with Recorder(path, session) as recorder:
        for number, label in enumerate(held):
            time_us, (closed, code) = 10_000 * number, readings(label)
            recorder.frame(GloveFrame(time_us, bytes(16) + bytes([code, 0]), 3))
            bits = sum(1 << at for at, name in enumerate(switches) if closed >> int(name[1:]) & 1)
            recorder.frame(SwitchFrame(time_us, bits))
    return path


def test_teach_cuts_recordings_of_any_build_into_the_same_grasps(build: Path, tmp_path: Path) -> None:
    types = "cprrpc"
    grasp_set = grasps_of(np.array(states("cprrpcpcr" * 2)))
    whole = compile_build(grasp_set, tmp_path / "whole", rounds=9, folds=0, placement="elimination", keep=3).folder
    assert len(Build.load(whole).manifest.switches) > len(Build.load(build).manifest.switches)
    own = record(build, tmp_path / "own.mcap", states(types))
    found = json.loads(thenar("segment", own, "-b", build, "--json").stdout)["segments"]
    assert [one["type"] for one in found] == ["cup", "pen", "rod", "rod", "pen", "cup"]
    others = (
        record(whole, tmp_path / "other.mcap", states(types)),
        collected(tmp_path / "collected.mcap", states(types), ("s9", "s2", "s0", "s1")),
    )
    for path in others:
        done = works("segment", path, "-b", build, "--json")
        # Of a collection each frame is a moment, of a run those of the run: up to a tick later.
        assert [one["type"] for one in json.loads(done.stdout)["segments"]] == [one["type"] for one in found]
        for one, same in zip(json.loads(done.stdout)["segments"], found, strict=True):
            for key in ("start_s", "end_s"):
                assert one[key] == pytest.approx(same[key], abs=0.011)
    assert thenar("teach", *others, "-b", build, "-o", tmp_path / "task.json").returncode == 0
    assert len(json.loads((tmp_path / "task.json").read_bytes())["steps"]) == len(types)


def test_a_recording_that_lacks_an_input_is_refused_by_name(build: Path, tmp_path: Path) -> None:
    for switches, joint, lacking in (
        (("s0", "s2"), "bend", "s1"),
        (("s0", "s1", "s2"), "bent", "bend"),
    ):
        path = collected(tmp_path / f"{joint}.mcap", states("c"), switches, joint)
        assert f"{path.name} was recorded without {lacking}, which the build" in refusal("segment", path, "-b", build)
