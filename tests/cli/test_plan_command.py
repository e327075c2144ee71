import json
from pathlib import Path

import msgspec
import pytest

from thenar.cli import run
from thenar.simulator import load_scene
from thenar.simulator.postures import Postures
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


def test_a_scene_is_not_overwritten_by_its_own_postures(with_new_object: Path, capsys: Captured) -> None:
    before = with_new_object.read_text()
    assert run(["plan", str(with_new_object), "-o", str(with_new_object)]) == 2
    assert "named twice" in capsys.readouterr().err
    assert with_new_object.read_text() == before
