"""`thenar segment`, and `thenar evaluate --streams`, on whole movements."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thenar.cli import run
from thenar.compiler import GraspSet, compile_build
from thenar.compiler.recordings.graspset import Joint
from thenar.compiler.recordings.taxonomy import own
from thenar.runtime.published import NONE

TYPES = ("hook", "pinch")
PARTS = (12, 30, 8)


@pytest.fixture(scope="module")
def movements(tmp_path_factory: pytest.TempPathFactory) -> Path:
    random = np.random.default_rng(3)
    order = [random.permutation([0, 0, 0, 1, 1, 1]) for _ in "ABC"]
    labels = np.concatenate([np.repeat([2, label, 2], PARTS) for each in order for label in each.tolist()])
    n, each = len(labels), sum(PARTS)
    made = GraspSet(
        switches=(labels[:, None] == np.arange(2)) ^ (random.random((n, 2)) < 0.05),
        switch_names=("palm", "tip"),
        codes=(np.array([200, 120, 20])[labels] + random.integers(-9, 10, n))[:, None].astype(np.uint16),
        joints=(Joint("bend", "deg", 0, 0.0, 255, 90.0),),
        grasps=np.array([*TYPES, NONE])[labels],
        taxonomy=own(TYPES),
        subjects=np.repeat(["A", "B", "C"], 6 * each),
        objects=np.full(n, "thing"),
        trials=np.arange(n) // each,
    )
    path = tmp_path_factory.mktemp("movements") / "movements.grasps"
    made.save(path)
    return path


@pytest.fixture(scope="module")
def build(movements: Path) -> Path:
    return compile_build(GraspSet.load(movements), movements.parent / "build", rounds=5, jobs=1).folder


@pytest.mark.parametrize("lag", [(), ("--lag-ms", "150")])
def test_segments_are_those_that_were_recorded(
    movements: Path, build: Path, lag: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = [tmp_path / name for name in ("s.csv", "s.eaf", "s.mcap", "s.svg")]
    for name in names:
        option = "--picture" if name.suffix == ".svg" else "-o"
        assert run(["segment", str(movements), "-b", str(build), option, str(name), *lag]) == 0
    assert "18 segments in 9.0 s of 3 streams" in capsys.readouterr().out
    assert len(names[0].read_text().splitlines()) == 19
    assert run(["segment", str(movements), "-b", str(build), "--json", *lag]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["f1"] == [1, 1, 1]
    grasp_set = GraspSet.load(movements)
    for number, one in enumerate(found["segments"]):
        start = number % 6 * 0.5 + 0.12
        assert one["start_s"] == pytest.approx(start, abs=0.021)
        assert one["end_s"] == pytest.approx(start + 0.3, abs=0.021)
        assert one["type"] == grasp_set.grasps[number * 50 + 20]
        assert 0.5 < one["confidence"] <= 1
        assert one["subject"] == "ABC"[number // 6]


def test_what_was_learnt_is_in_the_build(movements: Path, build: Path) -> None:
    manifest = json.loads((build / "build.json").read_text())
    assert manifest["segments"]["least"] == [15, 15, 10]


def test_refusals_say_what_to_do(
    movements: Path, build: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    grasp_set = GraspSet.load(movements)
    replace(grasp_set.without_none(), independent=True).save(tmp_path / "rows.grasps")
    assert run(["segment", str(tmp_path / "rows.grasps"), "-b", str(build)]) == 2
    assert "whole movements" in capsys.readouterr().err
    assert run(["segment", str(movements), "-b", str(build), "-o", str(movements)]) == 2
    capsys.readouterr()
    assert run(["evaluate", str(tmp_path / "rows.grasps"), "--streams"]) == 2
    assert "whole movements" in capsys.readouterr().err
    grasp_set.without_none().save(tmp_path / "held.grasps")
    assert run(["evaluate", str(tmp_path / "held.grasps"), "--streams"]) == 2
    assert "nothing is held" in capsys.readouterr().err
    assert run(["evaluate", str(movements), "--streams", "--subject", "A"]) == 2
    assert "a subject out takes two" in capsys.readouterr().err


def test_streams_are_evaluated_without_the_subject(
    movements: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = ["evaluate", str(movements), "--streams", "--rounds", "5", "--jobs", "1", "--json"]
    assert run([*line, "-o", str(tmp_path / "study.json")]) == 0
    study = json.loads(capsys.readouterr().out)
    assert study == json.loads((tmp_path / "study.json").read_text())
    assert (study["subjects"], study["movements"], study["seconds"]) == (["A", "B", "C"], 18, 9)
    rows = {(row["inputs"], row["method"]): row["values"] for row in study["rows"]}
    assert {inputs for inputs, _ in rows} == {"both", "switches", "joints"}
    live, dwell = rows["both", "decoder, live"], rows["both", "dwell 200 ms"]
    assert live["F1@50"]["mean"] > 0.95 > dwell["F1@50"]["mean"]
    assert live["onset ms"]["mean"] <= 20
    assert 130 <= live["latency ms"]["mean"] <= 170
    assert dwell["recognised"]["mean"] < live["recognised"]["mean"] == 1
    assert len(live["F1@50"]["subjects"]) == 3
    assert rows["both", "decoder, afterwards"]["latency ms"]["mean"] is None


def test_a_build_of_grasps_alone_finds_segments_by_what_it_refuses(
    movements: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    held = GraspSet.load(movements).without_none()
    folder = compile_build(held, tmp_path / "build", rounds=5, folds=0).folder
    assert "segments" not in json.loads((folder / "build.json").read_text())
    assert run(["segment", str(movements), "-b", str(folder), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["f1"][2] > 0.9
