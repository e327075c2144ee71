"""`thenar compare`: the paired difference of two builds, recomputed with numpy."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from thenar.compiler import Build, GraspSet, adapt, compile_build
from thenar.compiler.evaluation.rates import paired_interval
from thenar.compiler.samples import select_inputs

from ..compiler.conftest import make_set, with_none
from .conftest import refusal, thenar, works

# Trials of several frames, some of nothing held, of two subjects.
MADE = make_set(rows=240)
TRIALS = replace(MADE, trials=np.arange(240) // 12, subjects=np.where(np.arange(240) < 120, "ada", "bo"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with two builds of half of the trials, the second of joints alone, and sets to compare on."""
    where = tmp_path_factory.mktemp("compared")
    half = TRIALS.trials % 2 == 0
    compile_build(TRIALS.rows(half), where / "a", rounds=3, folds=0, inputs="switches", prune=30)
    compile_build(TRIALS.rows(half), where / "b", rounds=6, folds=0, inputs="joints")
    TRIALS.save(where / "all.grasps")
    TRIALS.rows(half).save(where / "old.grasps")
    with_none(make_set(rows=48, seed=9)).save(where / "none.grasps")
    replace(TRIALS, switch_names=tuple(f"x{at}" for at in range(TRIALS.switches.shape[1]))).save(where / "other.grasps")
    return where


def compared(folder: Path, a: str, b: str, grasp_set: str) -> dict[str, Any]:
    done = works("compare", folder / a, folder / b, folder / grasp_set, "--json")
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def majorities(folder: Path, grasp_set: GraspSet) -> dict[int, str]:
    """Return the grasp type that a build gives most frames of each trial, of equally many its first, frame by frame."""
    build, votes = Build.load(folder), dict[int, list[str]]()
    for *frame, trial in zip(*select_inputs(grasp_set, build.manifest), grasp_set.trial_ids.tolist(), strict=True):
        votes.setdefault(trial, []).append(build.classify(*frame))
    return {trial: max(build.classes, key=names.count) for trial, names in votes.items()}


def test_the_difference_is_that_of_the_majorities_of_trials_that_neither_was_trained_on(folder: Path) -> None:
    found = compared(folder, "a", "b", "all.grasps")
    new = TRIALS.rows(TRIALS.trials % 2 == 1)
    truth = dict(zip(new.trial_ids.tolist(), new.grasps.tolist(), strict=True))
    one, other = majorities(folder / "a", new), majorities(folder / "b", new)
    right = np.array([[said[trial] == truth[trial] for trial in truth] for said in (one, other)])
    assert found["of"] == "trials that neither build was trained on"
    assert (found["trials"], found["a"], found["b"]) == (len(truth), *right.sum(axis=1).tolist())
    assert found["difference"] == pytest.approx((right[1].astype(int) - right[0]).mean())
    assert (found["better"], found["worse"]) == ((right[1] & ~right[0]).sum(), (right[0] & ~right[1]).sum())
    assert found["p"] == pytest.approx(stats.binomtest(found["better"], found["better"] + found["worse"]).pvalue)
    assert [each["recorded"] for each in found["changed"]] == [truth[t] for t in truth if one[t] != other[t]]
    assert [(each["a"], each["b"]) for each in found["changed"]] == [
        (one[t], other[t]) for t in truth if one[t] != other[t]
    ]
    subjects = dict(zip(new.trial_ids.tolist(), (new.subjects == "bo").astype(np.intp), strict=True))
    ends = paired_interval(right[1].astype(np.intp) - right[0], np.array([*subjects.values()]))
    assert (found["low"], found["high"]) == pytest.approx(ends)
    assert found["low"] < found["difference"] < found["high"]
    for kind in found["types"]:
        those = np.array([name == kind["grasp"] for name in truth.values()])
        assert [kind["trials"], kind["a"], kind["b"]] == [those.sum(), *right[:, those].sum(axis=1)]
    assert sum(kind["trials"] for kind in found["types"]) == len(truth)
    back = compared(folder, "b", "a", "all.grasps")
    assert back["difference"] == -found["difference"]
    assert (back["low"], back["high"]) == pytest.approx((-found["high"], -found["low"]))


def test_a_changed_trial_is_named_as_the_recordings_number_it(folder: Path) -> None:
    first, *_ = compared(folder, "a", "b", "all.grasps")["changed"]
    named = (TRIALS.subjects == first["subject"]) & (TRIALS.trials == first["trial"])
    assert set(TRIALS.grasps[named & (TRIALS.grasps == first["recorded"])]) == {first["recorded"]}
    said = f"trial {first['trial']} of {first['subject']}, {first['object']}: {first['recorded']}, "
    assert said in thenar("compare", folder / "a", folder / "b", folder / "all.grasps").stdout


def test_a_build_does_not_differ_from_itself(folder: Path) -> None:
    found = compared(folder, "a", "a", "all.grasps")
    assert (found["difference"], found["better"], found["worse"], found["p"], found["changed"]) == (0, 0, 0, 1, [])
    assert found["low"] == -found["high"] < 0


def test_trials_that_were_trained_on_are_called_so(folder: Path) -> None:
    assert compared(folder, "a", "b", "old.grasps")["of"] == "trials that both builds were trained on"
    mine = TRIALS.rows(np.isin(TRIALS.trials, (1, 3)))
    adapt(folder / "b", mine, output=folder / "mine")
    mine.save(folder / "mine.grasps")
    assert compared(folder, "b", "mine", "mine.grasps")["of"] == "trials that the second build was trained on"
    assert compared(folder, "mine", "b", "mine.grasps")["of"] == "trials that the first build was trained on"
    done = thenar("compare", folder / "b", folder / "mine", folder / "mine.grasps")
    assert " trials that the second build was trained on: " in done.stdout


def test_rows_of_nothing_held_count_in_no_accuracy(folder: Path) -> None:
    held = GraspSet.load(folder / "none.grasps").without_none()
    found = compared(folder, "a", "b", "none.grasps")
    assert found["trials"] == held.n_trials
    assert "none" not in {kind["grasp"] for kind in found["types"]}


def test_a_set_that_lacks_inputs_of_a_build_is_refused_with_the_name_of_the_build(folder: Path) -> None:
    assert f"{folder / 'a'}: the recordings lack" in refusal(
        "compare", folder / "b", folder / "a", folder / "other.grasps"
    )


def test_the_interval_covers_the_difference_as_often_as_it_says() -> None:
    random, covered, draws = np.random.default_rng(5), 0, 1000
    for _ in range(draws):
        gained = random.choice([1, -1, 0], p=(0.12, 0.04, 0.84), size=80)
        low, high = paired_interval(gained, np.zeros(80, np.intp))
        covered += low <= 0.08 <= high
    assert 0.93 < covered / draws < 0.98


def test_subjects_who_differ_make_the_interval_wider() -> None:
    gained = np.tile([1, 0, -1, 0], 20)
    alike, mixed = np.arange(80) // 4, np.where(gained > 0, 0, np.where(gained < 0, 1, 2))
    plain = paired_interval(gained, np.zeros(80, np.intp))[1]
    assert plain < paired_interval(gained, alike)[1] < paired_interval(gained, mixed)[1] <= 1
    assert paired_interval(gained, np.arange(80))[1] == plain
