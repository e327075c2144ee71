import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from thenar.compiler import GraspSet, Joint, compile_build
from thenar.runtime import Build
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.live.system import LiveSystem
from thenar.runtime.preshape import PreshapeSelector, load_preshapes
from thenar.runtime.published import LiveGrasp
from thenar.runtime.recording.session import Session
from thenar.runtime.recording.writer import Recorder
from thenar.runtime.sinks import GraspLine

from .conftest import refusal, thenar, works


def test_every_frame_gives_one_line(small_set: GraspSet, set_file: Path, build_folder: Path) -> None:
    done = works("run", build_folder, "--replay", set_file)
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    build = Build.load(build_folder)
    kept = [switch.column for switch in build.manifest.switches]
    frames = zip(small_set.switches[:, kept], small_set.codes, strict=True)
    assert [line["grasp"] for line in lines] == [build.classify(bits, codes) for bits, codes in frames]
    assert [line["time_us"] for line in lines] == list(range(0, 10_000 * 60, 10_000))
    assert [line["recorded"] for line in lines] == small_set.grasps.tolist()
    assert list(lines[0]) == ["time_us", "grasp", "probability", "margin", "degraded", "recorded"]
    assert all(1 / 3 <= line["probability"] <= 1 and line["margin"] >= 0 and not line["degraded"] for line in lines)


@pytest.mark.parametrize(
    ("frames", "option", "values"),
    [
        ("run.mcap", "--status", ()),
        ("set.grasps", "--record", ("more.mcap",)),
        ("set.grasps", "--status", ()),
        ("set.grasps", "--lead", ("1",)),
        ("set.grasps", "--lag-ms", ("100",)),
        ("run.mcap", "--web", ()),
        ("set.grasps", "--web", ("127.0.0.1:0",)),
    ],
)
def test_an_option_that_would_change_nothing_is_refused(
    build_folder: Path, tmp_path: Path, frames: str, option: str, values: tuple[str, ...]
) -> None:
    (tmp_path / frames).touch()
    given = [str(tmp_path / value) if value.endswith(".mcap") else value for value in values]
    assert f"{option} has no effect" in refusal("run", build_folder, "--replay", tmp_path / frames, option, *given)


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
grasps = ["cup"]
[[preshapes]]
name = "narrow"
positions = [1]
grasps = ["pen"]
"""


@pytest.fixture
def gripper(tmp_path: Path) -> Path:
    path = tmp_path / "gripper.toml"
    path.write_text(GRIPPER)
    return path


def preshapes_of(gripper: Path, lines: list[dict[str, Any]], period_us: int) -> list[str | None]:
    """Return the names of the preshapes that a live run would give the grasps in these lines."""
    selector = PreshapeSelector(load_preshapes(gripper))
    moments = (
        LiveGrasp(n * period_us, 0, n, line["grasp"], line["grasp"], line["probability"], 0, "ok", None, None, 0)
        for n, line in enumerate(lines)
    )
    found = [selector.update(moment) for moment in moments]
    return [None if shape is None else shape.name for shape in found]


def test_a_replayed_set_takes_sinks_and_preshapes_as_a_live_run_does(
    set_file: Path, build_folder: Path, gripper: Path, tmp_path: Path
) -> None:
    run = ("run", build_folder, "--replay", set_file, "--preshape", gripper, "--frames", 50)
    done = works(*run)
    assert "none for rod: nothing is sent to the hand for those" in done.stderr
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    shapes = [line["preshape"] and line["preshape"]["name"] for line in lines]
    assert shapes == preshapes_of(gripper, lines, 10_000)
    done = thenar(*run, "--sink", f"jsonl:{tmp_path / 'one'}", "--sink", f"jsonl:{tmp_path / 'two'}")
    assert (done.returncode, done.stdout) == (0, "")
    for name in ("one", "two"):
        sent = msgspec.json.Decoder(GraspLine).decode_lines((tmp_path / name).read_bytes())
        assert [line.preshape and line.preshape.name for line in sent] == shapes
        assert [line.grasp for line in sent] == [line["grasp"] for line in lines]


def test_preshapes_follow_the_times_of_the_rows(
    small_set: GraspSet, build_folder: Path, gripper: Path, tmp_path: Path
) -> None:
    held = small_set.rows([*np.repeat(np.flatnonzero(small_set.labels == 0)[:1], 15), *[1] * 15])
    held.save(tmp_path / "held.grasps")
    done = thenar("run", build_folder, "--replay", tmp_path / "held.grasps", "--preshape", gripper)
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert [line["preshape"] and line["preshape"]["name"] for line in lines] == preshapes_of(gripper, lines, 10_000)
    assert {line["grasp"] for line in lines} == {"cup", "pen"}
    # A hand changes after 100 ms of the same call.
    assert [line["preshape"] is None for line in lines] == [True] * 10 + [False] * 20
    assert [line["preshape"]["name"] for line in lines[10:]] == ["wide"] * 15 + ["narrow"] * 5


GLOVE = """
[cyberglove]
port = "/dev/ttyUSB0"
sensors = 18
joints = ["j0", "j1", "c", "d", "e", "f", "g", "h", "i", "j", "k", "l", "m", "n", "o", "p", "q", "r"]
[[stream]]
port = "/dev/ttyACM0"
switches = ["s0", "s1", "s2", "s3", "s4", "s5"]
"""


def test_a_replayed_recording_takes_preshapes_too(small_set: GraspSet, gripper: Path, tmp_path: Path) -> None:
    joints = tuple(Joint(name, "deg", 1, 0.5, 255, 127.5) for name in small_set.joint_names)
    folder = compile_build(replace(small_set, joints=joints), tmp_path / "build", rounds=10, folds=0).folder
    build, path = Build.load(folder), tmp_path / "run.mcap"
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
        for number in range(40):
            time_us, row = 10_000 * number, number // 20
            codes = bytes(small_set.codes[row].tolist())
            glove = GloveFrame(time_us, codes + bytes(16), 3)
            bits = sum(1 << bit for bit, column in enumerate(kept) if small_set.switches[row, column])
            switches = SwitchFrame(time_us, bits)
            recorder.frame(glove)
            recorder.frame(switches)
            recorder.moment((), recognizer.step(time_us + 1, 0, switches, glove).grasp)
    done = thenar("run", folder, "--replay", path, "--preshape", gripper, "--frames", 30)
    assert "30 of 30 frames recognised as they were recorded" in done.stderr
    shapes = [line.preshape for line in msgspec.json.Decoder(GraspLine).decode_lines(done.stdout.encode())]
    assert {shape.name for shape in shapes if shape is not None} == {"wide"}
    assert len(shapes) == 30


def test_a_preshape_table_without_the_builds_grasp_types_is_refused(set_file: Path, build_folder: Path) -> None:
    assert "none of the build's grasp types (cup, pen, rod) is among the table's" in refusal(
        "run", build_folder, "--replay", set_file, "--preshape", "parallel_gripper"
    )
