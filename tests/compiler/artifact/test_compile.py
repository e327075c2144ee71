import hashlib
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thenar.compiler import TRAINERS, GraspSet, compile_build, grow_id3
from thenar.compiler.artifact import CompileError
from thenar.compiler.artifact.training import cuts_of
from thenar.compiler.artifact.verify import verify
from thenar.compiler.evaluation.folds import EvaluationError
from thenar.drivers.errors import ThenarError
from thenar.runtime import Build
from thenar.runtime.recipe import Inputs, Recipe

from ..conftest import make_set

ROUNDS = 12


def _bytes(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_build_knows_its_inputs_and_recognises_what_it_was_trained_on(grasp_set: GraspSet, tmp_path: Path) -> None:
    report = compile_build(grasp_set, tmp_path / "build", rounds=ROUNDS)
    assert re.fullmatch(r"<BuildReport \S+/build: 4 grasp types, \d+ switches, 3 joints>", repr(report))
    build = Build.load(tmp_path / "build")
    kept = [switch.column for switch in build.manifest.switches]
    frames = zip(grasp_set.switches[:, kept], grasp_set.codes, strict=True)
    found = np.array([build.classify(bits, codes) for bits, codes in frames])
    correct = int(np.count_nonzero(found == grasp_set.grasps))
    training, nested = report.manifest.rates
    assert (training.protocol, training.correct, training.total) == ("training", correct, len(grasp_set))
    assert (nested.protocol, nested.folds, nested.seed, nested.total) == ("nested", 4, 1, len(grasp_set))
    assert (nested.of, nested.unit) == ("within subject", "trials")
    assert correct > nested.correct > len(grasp_set) / 2
    assert build.grasps == ("cup", "pen", "plate", "rod")
    assert [switch.name for switch in build.manifest.switches] == [f"s{column}" for column in kept]
    assert [joint.name for joint in build.manifest.joints] == ["j0", "j1", "j2"]


def test_the_headline_of_several_subjects_is_the_new_subject_rate(tmp_path: Path) -> None:
    report = compile_build(make_set(subjects=3), tmp_path / "build", rounds=ROUNDS)
    rates = report.manifest.rates
    assert [(rate.protocol, rate.title, rate.unit, rate.folds, rate.total) for rate in rates] == [
        ("training", "rows trained on", "trials", 0, 96),
        ("nested", "new subject", "trials", 3, 96),
        ("nested", "pooled", "trials", 4, 96),
        ("nested", "new subject after adaptation", "trials", 3, 72),
    ]
    assert report.manifest.headline == rates[1]
    assert all(rate.low is not None and rate.low <= rate.rate <= (rate.high or 0) for rate in rates)
    # Over three people, not over 96 trials.
    assert (rates[1].high or 0) - (rates[1].low or 0) > 2 * ((rates[2].high or 0) - (rates[2].low or 0))
    assert report.confusion is not None
    assert int(report.confusion.trace()) == rates[1].correct
    document = json.loads((tmp_path / "build" / "build.json").read_bytes())
    assert document["rates"][1]["of"] == "new subject"
    assert "by" not in document["options"]


def test_what_is_new_is_asked_for(tmp_path: Path) -> None:
    whole = make_set(subjects=12)
    number = np.arange(96)
    parted = replace(
        whole, objects=np.where(number // 8 % 2, "cup", "jug"), sessions=np.where(number // 48 % 2, "late", "early")
    )
    seen = {}
    for by in ("trial", "subject", "object", "session"):
        rates = compile_build(parted, tmp_path / "build", rounds=1, by=by).manifest.rates[1:]
        seen[by] = [(rate.of, rate.folds) for rate in rates]
    # Twelve subjects, and their 24 sessions, are left out in ten groups.
    pooled = ("pooled", 4)
    assert seen == {
        "trial": [pooled],
        "subject": [("new subject", 10), pooled],
        "object": [("new object", 2), pooled],
        "session": [("new session", 10), pooled],
    }
    for by in ("object", "session"):
        with pytest.raises(EvaluationError, match=f"leaving one {by}.* out needs two or more"):
            compile_build(whole, tmp_path / "build", rounds=1, by=by)


def test_left_out_subjects_have_no_say_in_what_is_tested_on_them() -> None:
    for subjects in (3, 23):
        whole = make_set(subjects=subjects, rows=96, frames=2)
        cuts = cuts_of(whole, Recipe())
        for cut in cuts:
            assert np.array_equal(np.sort(np.concatenate([fold.test for fold in cut.folds])), np.arange(len(whole)))
            for fold in cut.folds:
                trained, tested = whole.rows(fold.train), whole.rows(fold.test)
                assert not set(whole.trial_ids[fold.train]) & set(whole.trial_ids[fold.test])
                assert cut.of == "pooled" or not set(trained.subjects) & set(tested.subjects)


def test_frames_of_a_trial_are_one_piece_of_evidence(tmp_path: Path) -> None:
    """Five equal frames a trial change no rate of trials, where random folds of frames would know all of them."""
    one = compile_build(make_set(rows=64), tmp_path / "one", rounds=ROUNDS, prune=1).manifest.rates
    five = compile_build(make_set(rows=64, frames=5), tmp_path / "five", rounds=ROUNDS, prune=1).manifest.rates
    assert [rate.unit for rate in five] == ["trials", "frames"] * 2
    for single, trials, frames in zip(one, five[::2], five[1::2], strict=True):
        assert (trials.correct, trials.total) == (single.correct, single.total)
        assert (frames.correct, frames.total) == (5 * single.correct, 5 * single.total)
    assert (five[3].high or 0) - (five[3].low or 0) > 0.6 * ((five[2].high or 0) - (five[2].low or 0))


def test_frames_that_are_numbered_as_trials_are_refused_before_any_work(tmp_path: Path) -> None:
    framed = make_set(rows=64, frames=6)
    drift = np.random.default_rng(1).integers(0, 3, framed.codes.shape).astype(np.uint16)
    numbered = replace(framed, codes=framed.codes + drift, trials=np.arange(len(framed)))
    with pytest.raises(CompileError, match="count as trials"):
        compile_build(numbered, tmp_path / "build", rounds=1, progress=lambda *_: pytest.fail("worked in vain"))
    claimed = replace(numbered, independent=True)
    assert compile_build(claimed, tmp_path / "build", rounds=1).manifest.source.independent
    assert compile_build(numbered, tmp_path / "build", rounds=1, folds=0).manifest.headline is None


OPEN: dict[str, Any] = {"trainer": "logit", "penalty": 1.0, "max_bins": 4}  # the smoothness is chosen


@pytest.mark.parametrize(
    "options",
    [
        {"rounds": ROUNDS, "prune": 5, "width": 5},
        pytest.param({"prune": 5, "width": 6, **OPEN}, marks=pytest.mark.slow),
        {"table_bits": 8, "keep": 4, "placement": "cmim", **OPEN},
        pytest.param({"rounds": 4, "keep_joints": 2}, marks=pytest.mark.slow),
        pytest.param({"width": 6}, marks=pytest.mark.slow),
    ],
)
def test_the_rates_are_those_of_builds_of_each_folds_training_rows(tmp_path: Path, options: dict[str, Any]) -> None:
    """All of it anew: placement, fit, integers. What is tested are the integers, whatever they lose."""
    whole = make_set(subjects=3)
    manifest = compile_build(whole, tmp_path / "build", **options).manifest
    assert bool(manifest.fitting) == ("rounds" not in options)
    (counted,) = verify(tmp_path / "build", whole).recognised
    training, *rates, _ = manifest.rates
    assert training.correct == counted.integers
    for rate, cut in zip(rates, cuts_of(whole, Recipe()), strict=True):
        correct = 0
        for fold in cut.folds:
            tested = whole.rows(fold.test)
            compile_build(whole.rows(fold.train), tmp_path / "fold", folds=0, **options)
            (counted,) = verify(tmp_path / "fold", tested).recognised
            correct += counted.integers
        assert (rate.correct, rate.total) == (correct, 96)


def test_a_choice_is_recorded_and_made_again_from_the_recorded_options(grasp_set: GraspSet, tmp_path: Path) -> None:
    manifest = compile_build(grasp_set, tmp_path / "build", folds=0, **OPEN).manifest
    fit, options = manifest.fit, manifest.options
    smoothness = {tried["smoothness"] for tried in TRAINERS["logit"].tried}
    assert manifest.fitting == fit
    assert (options.trainer, options.settings, options.max_bins) == ("logit", {"penalty": 1.0}, 4)
    assert (fit.trainer, fit.tried, fit.of) == ("logit", len(smoothness), "within subject")
    assert fit.settings["smoothness"] in smoothness
    assert {each.settings["smoothness"] for each in fit.compared} >= {fit.settings["smoothness"]}
    compile_build(grasp_set, tmp_path / "again", options)
    assert _bytes(tmp_path / "again") == _bytes(tmp_path / "build")
    # Asked for by name, it is the same model.
    given: dict[str, Any] = {name: value for name, value in fit.settings.items() if value is not None}
    alone = compile_build(grasp_set, tmp_path / "alone", trainer="logit", folds=0, **given)
    assert alone.manifest.fitting is None
    assert alone.manifest.fit.settings == fit.settings
    assert (tmp_path / "alone" / "tables.bin").read_bytes() == (tmp_path / "build" / "tables.bin").read_bytes()


@pytest.mark.slow
def test_any_number_of_workers_gives_the_same_bytes_and_counts_all_folds(tmp_path: Path) -> None:
    whole, seen = make_set(subjects=3, rows=192), []
    for jobs in (1, 2):
        told: list[tuple[int, int]] = []
        compile_build(
            whole, tmp_path / str(jobs), rounds=150, jobs=jobs, progress=lambda *step, told=told: told.append(step)
        )
        seen.append(told)
    assert _bytes(tmp_path / "1") == _bytes(tmp_path / "2")
    assert seen[0] == seen[1]
    assert seen[0][-1] == (8 * 150, 8 * 150)


def test_the_switches_are_the_placement_in_its_order(grasp_set: GraspSet, tmp_path: Path) -> None:
    manifest = compile_build(grasp_set, tmp_path / "build", rounds=1, prune=20, folds=0).manifest
    tree = grow_id3(grasp_set.switches, grasp_set.labels, min_samples=20)
    assert [switch.column for switch in manifest.switches] == list(tree.inputs)
    assert [switch.gain for switch in manifest.switches] == list(tree.gains)


def test_provenance_is_written(grasp_set: GraspSet, tmp_path: Path) -> None:
    report = compile_build(grasp_set, tmp_path / "build", rounds=ROUNDS, prune=5, shrinkage=0.5, folds=3, seed=9)
    document = json.loads((tmp_path / "build" / "build.json").read_bytes())
    assert document["options"] == {
        "prune": 5, "rounds": ROUNDS, "inputs": "both", "shrinkage": 0.5, "folds": 3, "seed": 9
    }  # fmt: skip
    assert document["source"]["fingerprint"] == grasp_set.fingerprint()
    assert document["proof"]["bound"] <= 32767
    inputs = len(document["switches"]) + len(document["joints"])
    assert (document["proof"]["error"], document["proof"]["safe_margin"]) == ((inputs + 1) / 2, inputs + 1)
    for member in ("tables", "ensemble"):
        data = (tmp_path / "build" / f"{member}.bin").read_bytes()
        assert document[f"{member}_sha256"] == hashlib.sha256(data).hexdigest()
    assert report.tables_bytes == (tmp_path / "build" / "tables.bin").stat().st_size
    assert str(tmp_path) not in (tmp_path / "build" / "build.json").read_text()


@pytest.mark.parametrize(("inputs", "switches", "joints"), [("switches", True, False), ("joints", False, True)])
def test_either_kind_of_input_will_do(
    grasp_set: GraspSet, tmp_path: Path, inputs: Inputs, switches: bool, joints: bool
) -> None:
    manifest = compile_build(grasp_set, tmp_path / "build", rounds=ROUNDS, inputs=inputs, folds=0).manifest
    assert (bool(manifest.switches), bool(manifest.joints)) == (switches, joints)
    assert Build.load(tmp_path / "build").tables.n_joints == 3 * joints


@pytest.mark.parametrize(
    ("shape", "options", "reason"),
    [
        ({"switches": 0}, {"inputs": "switches"}, "the recordings have no switches"),
        ({"joints": 0}, {"inputs": "joints"}, "the recordings have no joints"),
        ({"types": 1}, {}, "nothing to distinguish"),
        ({}, {"inputs": "switches", "prune": 1000}, "no switch is worth keeping: lower ``prune``"),
        ({}, {"rounds": 0}, "rounds=0"),
        ({}, {"shrinkage": 2.0}, "shrinkage=2.0"),
        ({}, {"prune": -1}, "min_samples is -1"),
        ({"rows": 4}, {"folds": 5}, "cannot be cut into 5 folds"),
        ({}, {"table_bits": 9}, "table_bits=9: firmware tables have entries of 8 or 16 bits"),
    ],
)
def test_what_makes_no_build_is_refused_and_nothing_written(
    tmp_path: Path, shape: dict[str, int], options: dict[str, Any], reason: str
) -> None:
    with pytest.raises((ThenarError, EvaluationError), match=reason):
        compile_build(make_set(**shape), tmp_path / "build", **{"rounds": 2, **options})
    assert list(tmp_path.iterdir()) == []


def test_tables_for_narrow_entries_are_coarser_say_so_and_hold(grasp_set: GraspSet, tmp_path: Path) -> None:
    lines: dict[str, Any] = {"trainer": "linear", "folds": 0}
    wide = compile_build(grasp_set, tmp_path / "wide", **lines).manifest
    narrow = compile_build(grasp_set, tmp_path / "narrow", table_bits=8, **lines).manifest
    tables = Build.load(tmp_path / "narrow").tables
    assert (narrow.options.table_bits, tables.grid) == (8, 256)
    assert narrow.proof.error > 8 * wide.proof.error
    assert narrow.proof.bound == tables.bound
    found = verify(tmp_path / "narrow", grasp_set)
    assert found.holds
    assert (found.covered, len(found.changed)) == (narrow.proof.covered, narrow.proof.changed)


def test_a_file_in_the_way_is_refused_before_any_work(grasp_set: GraspSet, tmp_path: Path) -> None:
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "mine.txt").write_text("keep me")
    with pytest.raises(CompileError, match="not empty and not a build"):
        compile_build(grasp_set, tmp_path / "notes", progress=lambda *_: pytest.fail("worked in vain"))


def test_joints_that_never_move_make_no_build(tmp_path: Path) -> None:
    still = replace(make_set(switches=0), codes=np.full((96, 3), 7, np.uint16))
    with pytest.raises(CompileError, match="no input differs between rows"):
        compile_build(still, tmp_path / "build")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("folds", [-1, 1, 97])
def test_impossible_folds_are_refused_before_any_work(grasp_set: GraspSet, tmp_path: Path, folds: int) -> None:
    with pytest.raises(EvaluationError, match="fold"):
        compile_build(grasp_set, tmp_path / "build", folds=folds, progress=lambda *_: pytest.fail("worked in vain"))


def test_a_fold_that_keeps_no_switch_is_named(grasp_set: GraspSet, tmp_path: Path) -> None:
    options: dict[str, Any] = {"inputs": "switches", "prune": 80, "rounds": 1}
    assert compile_build(grasp_set, tmp_path / "build", folds=0, **options).manifest.switches
    with pytest.raises(CompileError, match="in fold 1: no switch is worth keeping"):
        compile_build(grasp_set, tmp_path / "build", folds=4, **options)
