"""A glove of one's own, with pads and flex sensors, through every command: nothing says that it is another glove."""

import csv
import json
import re
from dataclasses import replace
from pathlib import Path
from shutil import copy
from typing import Any

import numpy as np
import pytest

from thenar.compiler.recordings.graspset import GraspSet, Joint
from thenar.runtime.harness.loading import load_harness
from thenar.runtime.manifest_file import manifest_from_bytes

from ..sets import grasp_set_of
from .conftest import refusal, thenar

PADS = tuple(f"pad_{finger}_{number}" for finger in ("thumb", "index", "palm") for number in (1, 2, 3))
FLEX = ("flex_thumb", "flex_index")
QUICK = ("--rounds", 5, "--folds", 2)
FOREIGN = re.compile(r"cyber ?glove|push.?button|EVQPLDA|murakami", re.IGNORECASE)
LAYOUT = "outline = [[20, 10], [10, 230], [150, 230], [160, 10]]\n[places]\n" + "".join(
    f"{name} = [{40 + 30 * (place % 3)}, {190 - 40 * (place // 3)}]\n" for place, name in enumerate(PADS)
)


@pytest.fixture(scope="module")
def grasps(tmp_path_factory: pytest.TempPathFactory) -> Path:
    random, rows, types = np.random.default_rng(3), 120, ("cup", "pen", "rod")
    labels = np.arange(rows) % 3
    closed, centres = random.random((3, len(PADS))) < 0.5, random.integers(500, 3500, (3, len(FLEX)))
    noisy = centres[labels] + random.normal(0, 500, (rows, len(FLEX)))
    path = tmp_path_factory.mktemp("own") / "own.grasps"
    grasp_set_of(
        types,
        labels,
        switches=closed[labels] ^ (random.random((rows, len(PADS))) < 0.1),
        switch_names=PADS,
        codes=np.clip(noisy, 0, 4095),
        joints=tuple(Joint(name, "V", 0, 0.0, 4095, 3.3) for name in FLEX),
        subjects=np.where(np.arange(rows) // 3 % 2, "A", "B"),
        trials=np.arange(rows) // 6,
    ).save(path)
    return path


@pytest.fixture(scope="module")
def layout(grasps: Path) -> Path:
    path = grasps.with_name("layout.toml")
    path.write_text(LAYOUT)
    return path


def worked(done: Any) -> str:
    """Return what a command printed, once it has worked and named no glove that this is not."""
    assert done.returncode == 0, done.stderr
    assert not FOREIGN.search(done.stdout + done.stderr), done.stdout + done.stderr
    return " ".join((done.stdout + done.stderr).split())


def foreign(folder: Path) -> list[str]:
    """Return the files that name a glove that this is not; but those of firmware, whose program can read any."""
    files = [path for path in folder.rglob("*") if path.is_file() and "firmware" not in path.parts]
    assert files
    return [path.name for path in files if FOREIGN.search(path.read_text(errors="replace"))]


def test_a_build_its_report_and_its_spec_are_of_this_glove(grasps: Path, layout: Path, tmp_path: Path) -> None:
    build, glove = tmp_path / "build", tmp_path / "glove.toml"
    said = worked(thenar("compile", grasps, "-o", build, *QUICK, "--layout", layout, "--propose", glove))
    assert "joints flex_thumb, flex_index need a source of your own" in said
    assert load_harness(glove).cyberglove is None
    worked(thenar("compile", grasps, "-o", build, *QUICK, "--layout", layout, "--glove", glove))
    report = (build / "report.html").read_text()
    assert "Joints flex_thumb, flex_index need a source of your own" in report
    page = json.loads(re.findall(r'id="page-data">(.*?)</script>', report)[0])
    assert len(page["hand"]["switches"]) >= len(PADS)
    said = worked(thenar("spec", build, "--layout", layout, "-o", tmp_path / "spec"))
    assert "your own switch or pad" in said
    assert "need a source of your own" in said
    kept = [switch.name for switch in manifest_from_bytes((build / "build.json").read_bytes()).switches]
    places = {each["name"]: (each["x_mm"], each["y_mm"]) for each in json.loads(_spec(tmp_path))["sensors"]}
    assert places == {name: (40.0 + 30 * (n % 3), 190.0 - 40 * (n // 3)) for n, name in enumerate(PADS) if name in kept}
    assert "<svg" in (tmp_path / "spec" / "cutting.svg").read_text()
    assert foreign(tmp_path) == []


def test_pads_and_joints_are_counted_as_sensors_everywhere(grasps: Path, tmp_path: Path) -> None:
    """Each pad is analog, with several levels: what is bought is a pad, and a flex sensor for each joint."""
    plain = GraspSet.load(grasps)
    random = np.random.default_rng(4)
    pressed = np.where(
        plain.switches, random.normal(2500, 500, plain.switches.shape), random.normal(700, 400, plain.switches.shape)
    )
    analog = replace(
        plain,
        switches=np.zeros((len(plain), 0), bool),
        switch_names=(),
        taxels=np.clip(pressed, 0, 4095).astype(np.uint16),
        taxel_columns=tuple(Joint(name, "counts", 0, 0.0, 4095, 4095.0) for name in PADS),
    )
    analog.save(path := tmp_path / "analog.grasps")
    layout = tmp_path / "glove.toml"
    places = "".join(f"{name} = [{30 * n}, {20 * (n % 2)}]\n" for n, name in enumerate(PADS))
    layout.write_text(f'part_number = "FSR 402"\n[places]\n{places}')
    asked, build = ("--method", "elimination", "--keep", 7), tmp_path / "build"
    said = worked(thenar("compile", path, "-o", build, "--rounds", 5, "--folds", 0, *asked, "--layout", layout))
    manifest = manifest_from_bytes((build / "build.json").read_bytes())
    kept = {switch.source for switch in manifest.switches}
    assert len(kept) < len(manifest.switches) == 7
    pads = f"{len(kept)} of 9 pads (7 levels)"
    sensors = f"{pads} and 2 of 2 joints"
    assert f"3 grasp types from {sensors};" in said
    assert re.search(r"\d of 9 pads \(7 levels\)", worked(thenar("place", path, *asked)))
    report = (build / "report.html").read_text()
    assert f"recognises 3 grasp types from {sensors};" in report
    assert "of 9 switches" not in report
    told = worked(thenar("spec", build, "--layout", layout, "-o", tmp_path / "spec"))
    assert f"{sensors}; a proposed wiring" in told
    readme = (tmp_path / "spec" / "README.txt").read_text()
    assert readme.startswith(f"proposed: a glove with {sensors}\n")
    for words in (readme, told):
        assert "switch" not in words
        assert "bounce" not in words
    with (tmp_path / "spec" / "bom.csv").open() as file:
        bill = {row["what"]: row for row in csv.DictReader(file)}
    fsr, flex = bill["your own force sensing pad"], bill["your own joint sensor"]
    assert (fsr["quantity"], fsr["part_number"]) == (str(len(kept)), "FSR 402")
    assert (flex["quantity"], flex["designators"]) == ("2", "flex_thumb flex_index")


def _spec(folder: Path) -> str:
    return (folder / "spec" / "spec.json").read_text()


def test_the_live_commands_say_that_nothing_reads_the_joints(grasps: Path, tmp_path: Path) -> None:
    build, glove = tmp_path / "build", tmp_path / "glove.toml"
    worked(thenar("compile", grasps, "-o", build, *QUICK, "--no-report", "--propose", glove))
    looked = thenar("doctor", glove, "--build", build)
    assert looked.returncode == 1
    for done in (looked, thenar("run", build, "--glove", glove, "--frames", 1)):
        words = " ".join((done.stdout + done.stderr).split())
        assert "nothing in 'glove' reads the build's joints" in words
        assert "need a source of your own" in words
        assert not FOREIGN.search(words)


def test_without_a_layout_nothing_is_drawn_and_with_one_everything_is(
    grasps: Path, layout: Path, tmp_path: Path
) -> None:
    assert "the position of switch 'pad_thumb_1' is unknown: say it with --layout" in refusal(
        "draw", grasps, "-o", tmp_path / "no.svg"
    )
    build = tmp_path / "build"
    layout.with_name("few.toml").write_text("[places]\npad_thumb_1 = [1, 2]\n")
    assert "'pad_thumb_2' is no switch of the glove few.toml" in refusal(
        "compile", grasps, "-o", build, *QUICK, "--layout", layout.with_name("few.toml")
    )
    assert not build.exists()
    for options in (["--per-grasp"], []):
        worked(thenar("draw", grasps, "--layout", layout, *options, "-o", tmp_path / "a.svg", "--overwrite"))
        picture = (tmp_path / "a.svg").read_text()
        assert "pad_thumb_1" in picture
        assert not FOREIGN.search(picture)


@pytest.mark.slow
def test_a_frontier_omits_unknown_joint_times_unless_they_are_given(grasps: Path, tmp_path: Path) -> None:
    few = ("--methods", "id3", "--rounds", 5, "--repeats", 1, "--finalists", 1, "--jobs", 1)
    # Nothing is left to choose.
    settled = ("--trainer", "logitboost", "--shrinkage", 1, "--max-bins", 65536)
    found: dict[str, list[Any]] = {}
    for name, more in (("left out", ()), ("given", ("--joint-us", 5000))):
        if found:  # all else has been asked already
            (tmp_path / name).mkdir()
            copy(tmp_path / "left out" / "store.sqlite", tmp_path / name)
        said = worked(thenar("frontier", grasps, "-o", tmp_path / name, *few, *settled, "--target", "avr328p", *more))
        assert ("the time of reading the joints (flex_thumb, flex_index) is unknown" in said) == (name == "left out")
        points = json.loads((tmp_path / name / "frontier.json").read_text())["points"]
        found[name] = [point for point in points if point["setting"]["inputs"] != "switches"]
        assert found[name]
        assert foreign(tmp_path / name) == []
    assert {point["transfer"]["how"] for point in found["left out"]} == {"unknown"}
    assert {(point["transfer"]["how"], point["transfer"]["us"]) for point in found["given"]} == {("given", 5000.0)}
    assert all(point["frame"]["us"] >= 5000.0 for point in found["given"])
