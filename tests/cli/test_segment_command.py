"""`thenar segment`, and `thenar evaluate --streams`, on whole movements."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thenar.cli import run
from thenar.compiler import TRAINERS, GraspSet, Samples, compile_build
from thenar.compiler.artifact import stream_study
from thenar.compiler.recordings.graspset import Joint
from thenar.compiler.trainers.base import Trainer

from ..sets import grasp_set_of
from .conftest import refusal, works

TYPES = ("hook", "pinch")
PARTS = (12, 30, 8)


@pytest.fixture(scope="module")
def movements(tmp_path_factory: pytest.TempPathFactory) -> Path:
    random = np.random.default_rng(3)
    order = [random.permutation([0, 0, 0, 1, 1, 1]) for _ in "ABC"]
    labels = np.concatenate([np.repeat([2, label, 2], PARTS) for each in order for label in each.tolist()])
    n, each = len(labels), sum(PARTS)
    made = grasp_set_of(
        TYPES,
        labels,
        switches=(labels[:, None] == np.arange(2)) ^ (random.random((n, 2)) < 0.05),
        switch_names=("palm", "tip"),
        codes=(np.array([200, 120, 20])[labels] + random.integers(-9, 10, n))[:, None],
        joints=(Joint("bend", "deg", 0, 0.0, 255, 90.0),),
        subjects=np.repeat(["A", "B", "C"], 6 * each),
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
    names = [tmp_path / name for name in ("s.csv", "s.svg")]
    for name in names:
        option = "--picture" if name.suffix == ".svg" else "-o"
        assert run(["segment", str(movements), "-b", str(build), option, str(name), *lag]) == 0
    assert "18 segments in 9.0 s of 3 streams" in capsys.readouterr().out
    assert len(names[0].read_text().splitlines()) == 19
    found = json.loads(works("segment", movements, "-b", build, "--json", *lag).stdout)
    assert found["f1"] == [1, 1, 1]
    grasp_set = GraspSet.load(movements)
    for number, one in enumerate(found["segments"]):
        start = number % 6 * 0.5 + 0.12
        assert one["start_s"] == pytest.approx(start, abs=0.021)
        assert one["end_s"] == pytest.approx(start + 0.3, abs=0.021)
        assert one["type"] == grasp_set.grasps[number * 50 + 20]
        assert 0.5 < one["confidence"] <= 1
        assert one["subject"] == "ABC"[number // 6]


def _repeated(times: np.ndarray, _: np.random.Generator) -> np.ndarray:
    return np.asarray(times // 20_000 * 20_000)


def _jittering(times: np.ndarray, random: np.random.Generator) -> np.ndarray:
    return np.asarray(times + random.integers(-9_000, 9_001, len(times)))


def _late(times: np.ndarray, _: np.random.Generator) -> np.ndarray:
    return np.asarray(times + 900_000 * (np.arange(len(times)) > 130))


@pytest.mark.parametrize("damage", [_repeated, _jittering, _late])
def test_a_real_clock_changes_no_segment(
    movements: Path,
    build: Path,
    damage: Callable[[np.ndarray, np.random.Generator], np.ndarray],
    tmp_path: Path,
) -> None:
    clean, random = GraspSet.load(movements), np.random.default_rng(5)
    times = np.concatenate([damage(10_000 * np.arange(300), random) for _ in "ABC"])
    # Single frames that could not be read are rows that are not there.
    read = random.random(len(clean)) > 0.03
    replace(clean, times_us=times).rows(np.flatnonzero(read)).save(tmp_path / "damaged.grasps")
    found = json.loads(works("segment", tmp_path / "damaged.grasps", "-b", build, "--json").stdout)
    assert (found["streams"], len(found["segments"])) == (3, 18)
    assert min(found["f1"]) > 0.99


def test_a_pause_ends_a_stream_but_divides_no_true_grasp(movements: Path, build: Path, tmp_path: Path) -> None:
    clean, paused = GraspSet.load(movements), tmp_path / "paused.grasps"
    times = np.tile(10_000 * np.arange(300), 3)
    times[127:300] += 1_100_000  # in the middle of A's third grasp
    replace(clean, times_us=times).save(paused)
    found = json.loads(works("segment", paused, "-b", build, "--json").stdout)
    assert (found["streams"], len(found["segments"])) == (4, 19)
    assert found["f1"][0] == pytest.approx(2 * 18 / (18 + 19))


def test_what_was_learnt_is_in_the_build(movements: Path, build: Path) -> None:
    manifest = json.loads((build / "build.json").read_text())
    assert manifest["segments"]["least"] == [15, 15, 10]


def test_refusals_say_what_to_do(
    movements: Path, build: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    grasp_set = GraspSet.load(movements)
    replace(grasp_set.without_none(), independent=True).save(tmp_path / "rows.grasps")
    assert "whole movements" in refusal("segment", tmp_path / "rows.grasps", "-b", build)
    assert run(["segment", str(movements), "-b", str(build), "-o", str(movements)]) == 2
    capsys.readouterr()
    assert "whole movements" in refusal("evaluate", tmp_path / "rows.grasps", "--streams")
    grasp_set.without_none().save(tmp_path / "held.grasps")
    assert "nothing is held" in refusal("evaluate", tmp_path / "held.grasps", "--streams")
    assert "a subject out takes two" in refusal("evaluate", movements, "--streams", "--subject", "A")


def test_streams_are_evaluated_without_the_subject(
    movements: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = ["evaluate", str(movements), "--streams", "--rounds", "5", "--jobs", "1", "--json"]
    assert run([*line, "-o", str(tmp_path / "study.json")]) == 0
    printed = capsys.readouterr()
    study, told = json.loads(printed.out), printed.err.splitlines()
    assert told[:2] == ["evaluating streams ...", "evaluating streams: 0 of 12 steps"]
    assert told[-1] == "evaluating streams: 12 of 12 steps"
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


@pytest.mark.slow
@pytest.mark.parametrize("most", [5500, 200])  # more, and fewer, than two rows of each movement
def test_of_many_movements_few_frames_are_learnt_from(
    most: int, movements: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    once, boosted, learnt = GraspSet.load(movements), type(TRAINERS["logitboost"]), []
    rows = np.flatnonzero(once.subjects != "C")
    times = 30
    many = once.rows(np.tile(rows, times))
    trials = many.trials + 1000 * np.repeat(np.arange(times), len(rows))
    order = np.argsort(many.subjects, kind="stable")
    replace(many, trials=trials, times_us=np.empty(0, np.int64)).rows(order).save(tmp_path / "many.grasps")
    train = boosted.train

    def counted(self: Trainer, samples: Samples, *settings: Any) -> Any:
        learnt.append(len(samples.labels))
        return train(self, samples, *settings)

    monkeypatch.setattr(boosted, "train", counted)
    monkeypatch.setattr(stream_study, "_LEARNT", most)
    line = ["evaluate", str(tmp_path / "many.grasps"), "--streams", "--rounds", "1", "--jobs", "1", "--json"]
    study = json.loads(works(*line).stdout)
    assert study["movements"] == 360
    assert most / 5 < max(learnt) <= most
    assert study["rows"][0]["values"]["F1@50"]["mean"] > 0.95


def test_a_build_of_grasps_alone_finds_segments_by_what_it_refuses(movements: Path, tmp_path: Path) -> None:
    held = GraspSet.load(movements).without_none()
    folder = compile_build(held, tmp_path / "build", rounds=5, folds=0).folder
    assert "segments" not in json.loads((folder / "build.json").read_text())
    assert json.loads(works("segment", movements, "-b", folder, "--json").stdout)["f1"][2] > 0.9
