import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from thenar.cli import run
from thenar.simulator import load_scene
from thenar.simulator.planning.postures import Postures
from thenar.simulator.scenes import shipped

Captured = pytest.CaptureFixture[str]


def test_a_scene_of_shipped_objects_needs_no_planning(tmp_path: Path, capsys: Captured) -> None:
    path = tmp_path / "postures.json"
    assert run(["plan", "quick", "-o", str(path), "--jobs", "1"]) == 0
    assert "0 object(s) planned: all were planned already" in capsys.readouterr().out
    scene = load_scene("quick")
    for item in scene.objects:
        assert Postures.load(path).entry(item.grasp, item.thing()) is not None


@pytest.fixture
def with_new_object(tmp_path: Path) -> Path:
    """Return the scene of the shipped objects and one that nobody planned yet."""
    text = shipped()["quick"].read_text()
    path = tmp_path / "scene.toml"
    objects = "".join(
        f'[[objects]]\nname = "{item.name}"\ngrasp = "{item.grasp}"\nmass_g = {item.mass_g}\n{_shape(item.shape)}\n'
        for item in load_scene("quick").objects
    )
    new = '[[objects]]\nname = "rod"\ngrasp = "PoS"\nmass_g = 80\nshape = "cylinder"\n'
    size = "diameter_mm = 33.5\nlength_mm = 200\n"
    path.write_text(text.replace('objects = "kamakura14"', "") + objects + new + size)
    return path


def _shape(shape: object) -> str:
    return "\n".join(f"{key} = {json.dumps(value)}" for key, value in msgspec.to_builtins(shape).items())


@pytest.mark.slow
def test_an_object_of_ones_own_is_planned_and_can_then_be_simulated(
    with_new_object: Path, tmp_path: Path, capsys: Captured
) -> None:
    path = tmp_path / "postures.json"
    made = ["-o", str(tmp_path / "set.grasps"), "--repetitions", "3", "--jobs", "1"]
    assert run(["simulate", str(with_new_object), *made]) == 2
    assert "no planned posture of grasp type 'PoS' with object 'rod'" in capsys.readouterr().err
    assert run(["plan", str(with_new_object), "-o", str(path), "--jobs", "1"]) == 0
    printed = capsys.readouterr().out
    assert f"{path}: 1 object(s) planned" in printed
    (row,) = (line for line in printed.splitlines() if "rod" in line)
    assert row.split("│")[1].strip() == "PoS"
    with_new_object.write_text('postures = "postures.json"\n' + with_new_object.read_text())
    assert run(["simulate", str(with_new_object), *made]) == 0


def scene_of(name: str, postures: str, change: str, **changes: object) -> str:
    """Return a shipped scene with its objects written out, the one called `change` changed, and a file of postures."""
    objects = [
        msgspec.structs.replace(item, shape=msgspec.structs.replace(item.shape, **changes))
        if item.name == change
        else item
        for item in load_scene(name).objects
    ]
    written = "".join(
        f"[[objects]]\nname = {json.dumps(item.name)}\ngrasp = {json.dumps(item.grasp)}\nmass_g = {item.mass_g}\n"
        f"{_shape(item.shape)}\n"
        for item in objects
    )
    lines = [line for line in shipped()[name].read_text().splitlines() if not line.startswith("objects = ")]
    return "\n".join([f"postures = {json.dumps(postures)}", *lines, written])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "change", "changes"),
    [("kamakura", "bead", {"diameter_mm": 8.0}), ("cutkosky", "jar lid, tight", {"diameter_mm": 80.0})],
)
def test_a_scene_that_names_the_file_before_it_is_there_is_planned_and_simulated(
    name: str, change: str, changes: dict[str, float], tmp_path: Path, capsys: Captured
) -> None:
    scene, postures = tmp_path / "scene.toml", tmp_path / "postures.json"
    scene.write_text(scene_of(name, "postures.json", change, **changes))
    made = ["simulate", str(scene), "-o", str(tmp_path / "set.grasps"), "--repetitions", "2", "--jobs", "1"]
    assert run(made) == 2
    assert "postures.json: there is no such file of planned postures: `thenar plan` makes it" in capsys.readouterr().err
    assert run(["plan", str(scene), "-o", str(postures), "--json", "--jobs", "1"]) == 0
    (planned,) = json.loads(capsys.readouterr().out)
    assert planned["entry"]["object"] == change
    assert run(made) == 0
    assert run(["plan", str(scene), "-o", str(tmp_path / "again.json"), "--jobs", "1"]) == 0
    assert (tmp_path / "again.json").read_bytes() == postures.read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_an_object_that_no_hand_can_hold_is_one_sentence_and_no_file(
    jobs: str, tmp_path: Path, capsys: Captured
) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(scene_of("kamakura", "postures.json", "bead", diameter_mm=190.0))
    assert run(["plan", str(scene), "-o", str(tmp_path / "postures.json"), "--jobs", jobs]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    (sentence,) = printed.err.splitlines()
    assert sentence.startswith("thenar: a hand of 195 mm cannot hold 'bead' with grasp type 'Tip': the best posture")
    assert sentence.endswith("take an object of another size, or another grasp type for it")
    assert [path.name for path in tmp_path.iterdir()] == ["scene.toml"]


def test_an_interrupt_ends_with_130_and_leaves_the_old_postures_alone(tmp_path: Path) -> None:
    old, ready = tmp_path / "postures.json", tmp_path / "ready"
    old.write_bytes(b"old")
    program = (
        "import pathlib, sys\n"
        "from contextlib import contextmanager\n"
        "from thenar.cli import plan_command as module\n"
        "@contextmanager\n"
        f"def telling(what): yield lambda done, total: pathlib.Path({str(ready)!r}).touch()\n"
        "module.progress = telling\n"
        "from thenar.cli import run\n"
        "sys.exit(run(sys.argv[1:]))"
    )
    command = [sys.executable, "-c", program, "plan", "quick", "--anew", "--jobs", "2", "-o", str(old), "--overwrite"]
    process = subprocess.Popen(
        command, start_new_session=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        while not ready.exists():
            assert process.poll() is None
            os.sched_yield()
        os.killpg(process.pid, signal.SIGINT)
        printed, complaints = process.communicate(timeout=60)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
    assert (process.returncode, printed, complaints.strip()) == (130, "", "thenar: interrupted")
    assert old.read_bytes() == b"old"
    assert {path.name for path in tmp_path.iterdir()} == {"postures.json", "ready"}
