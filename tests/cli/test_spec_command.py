"""`thenar spec`: the reduced glove of a build, printed and written."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler import GraspSet, compile_build
from thenar.compiler.glove.files import spec_files
from thenar.compiler.glove.propose import propose_harness
from thenar.runtime import Build
from thenar.runtime.harness.loading import load_harness
from thenar.runtime.harness.writing import harness_to_toml
from thenar.simulator.handmaps.handmap import hand_map

from ..sets import grasp_set_of
from .conftest import refusal, thenar, works

NAMES = ("thumb_distal_5", "palm_heel_6", "index_distal_3", "little_distal_8")


@pytest.fixture(scope="module")
def hand_set() -> GraspSet:
    """Four switches of the shipped glove that tell three grasp types apart."""
    labels = np.arange(30) % 3
    closed = np.array([[0, 0, 1, 1], [0, 1, 0, 1], [1, 0, 0, 0]])
    return grasp_set_of(["cup", "pen", "rod"], labels, switches=closed[labels], switch_names=NAMES)


@pytest.fixture(scope="module")
def hand_build(hand_set: GraspSet, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compile_build(hand_set, tmp_path_factory.mktemp("hand") / "build", rounds=3, folds=0).folder


def said(done: subprocess.CompletedProcess[str]) -> str:
    assert done.returncode == 0, done.stderr
    return " ".join(done.stdout.split())


def test_a_spec_is_printed_and_written(hand_build: Path, tmp_path: Path) -> None:
    folder = tmp_path / "a" / "spec"
    told = said(thenar("spec", hand_build, "-o", folder))
    manifest = Build.load(hand_build).manifest
    names = [switch.name for switch in manifest.switches]
    sensors = f"{len(names)} of {manifest.source.switches} switches"
    assert f"{sensors}; a proposed wiring, for a right hand of 190 mm" in told
    assert all(name in told for name in names)
    assert "A whole scan: 1 transaction, " in told
    written = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert written == spec_files(manifest, hand=hand_map().fitted(names))
    assert load_harness(folder / "glove.toml").switches == tuple(names)


def test_a_home_that_cannot_be_read_ends_nothing(hand_build: Path, tmp_path: Path) -> None:
    """No name of a file is that long, so its folders can no more be searched than those of somebody else."""
    command = [sys.executable, "-m", "thenar.cli", "spec", str(hand_build), "-o", str(tmp_path / "spec")]
    home = "/" + 300 * "a"
    away = {**os.environ, "HOME": home, "XDG_CONFIG_HOME": f"{home}/config", "XDG_CACHE_HOME": f"{home}/cache"}
    said(subprocess.run(command, capture_output=True, text=True, check=False, env=away))
    hand = hand_map().fitted([switch.name for switch in Build.load(hand_build).manifest.switches])
    written = {path.name: path.read_bytes() for path in (tmp_path / "spec").iterdir()}
    assert written == spec_files(Build.load(hand_build).manifest, hand=hand)


def test_without_a_folder_nothing_is_written(hand_build: Path) -> None:
    before = sorted(hand_build.rglob("*"))
    said(thenar("spec", hand_build))
    assert sorted(hand_build.rglob("*")) == before


def test_machines_get_the_same_as_spec_json(hand_build: Path, tmp_path: Path) -> None:
    done = works("spec", hand_build, "--json", "--hand-length", 171, "-o", tmp_path / "spec")
    assert json.loads(done.stdout) == json.loads((tmp_path / "spec" / "spec.json").read_bytes())
    assert json.loads(done.stdout)["hand_length_mm"] == 171


def test_the_bill_has_every_sensor_once_with_part_and_price(build_folder: Path, tmp_path: Path) -> None:
    """Joints, too; without the list the parts of sensors are thenar's own."""
    prices = tmp_path / "prices.toml"
    prices.write_text(
        '[[part]]\nname = "flex"\nnumber = "FS7"\nprice = 11.5\nsensors = ["j*"]\n'
        '[[part]]\nname = "button"\nprice = 2\nsensors = ["s*"]'
    )
    summary = json.loads(thenar("spec", build_folder, "--prices", prices, "--json").stdout)
    bought = [line for line in summary["materials"] if line.get("price")]
    manifest = Build.load(build_folder).manifest
    refs = {sensor["name"]: f"SW{sensor['number']}" for sensor in summary["sensors"]}
    expected = {"button": {refs[switch.name] for switch in manifest.switches}}
    expected |= {"flex": {joint.name for joint in manifest.joints}} if manifest.joints else {}
    assert {line["what"]: set(line["designators"]) for line in bought} == expected
    listed = [ref for line in summary["materials"] for ref in line["designators"]]
    assert all(listed.count(ref) == 1 for refs in expected.values() for ref in refs)
    assert [(line["part"], line["quantity"] * line["price"]) for line in bought if line["what"] == "flex"] == [
        ("FS7", 11.5 * len(manifest.joints))
    ]
    prices.write_text('[[part]]\nname = "flex"\nprice = 11.5\nsensors = ["j*"]\n')
    assert "has no part for" in refusal("spec", build_folder, "--prices", prices)


@pytest.mark.slow
def test_a_glove_is_described_as_it_is_wired(hand_set: GraspSet, tmp_path: Path) -> None:
    glove = tmp_path / "bench.toml"
    glove.write_text(harness_to_toml(propose_harness(["spare", *NAMES], "pca9555", name="bench")))
    build = compile_build(hand_set, tmp_path / "build", rounds=3, folds=0, harness=load_harness(glove)).folder
    assert "name its glove.toml with --glove" in refusal("spec", build)
    told = said(thenar("spec", build, "--glove", glove, "-o", build / "spec"))
    assert "wired as bench" in told
    assert "U1: pca9555 at 0x20" in told
    assert "wired as bench" in said(thenar("spec", build)), "the wiring that the build holds"


def test_a_glove_of_ones_own_has_no_pattern_and_no_length(build_folder: Path, tmp_path: Path) -> None:
    told = said(thenar("spec", build_folder, "-o", tmp_path / "spec"))
    assert "the positions of this glove's sensors are unknown" in told
    assert not (tmp_path / "spec" / "cutting.svg").exists()
    assert "use --layout instead" in refusal("spec", build_folder, "--hand-length", 180)


def test_a_spec_is_replaced_whole_and_anything_else_is_kept(
    hand_build: Path, build_folder: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "spec"
    said(thenar("spec", hand_build, "-o", folder))
    assert (folder / "cutting.svg").exists()
    said(thenar("spec", build_folder, "-o", folder))
    assert not (folder / "cutting.svg").exists()
    other = tmp_path / "other"
    other.mkdir()
    (other / "letter.txt").write_text("dear")
    assert "is not a spec" in refusal("spec", hand_build, "-o", other)
    assert [path.name for path in other.iterdir()] == ["letter.txt"]
