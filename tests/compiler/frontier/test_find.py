"""The whole of a frontier, over small sets: what every one must satisfy, sets with little in them, and going on."""

import csv
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace as replace_rows
from functools import cache
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.typing import NDArray

from thenar.compiler.artifact.compile import compile_build
from thenar.compiler.evaluation.folds import weka_folds
from thenar.compiler.frontier import price
from thenar.compiler.frontier.cache import stored
from thenar.compiler.frontier.find import find_frontier
from thenar.compiler.frontier.picked import picked
from thenar.compiler.frontier.plots import picture
from thenar.compiler.frontier.points import Frontier, FrontierError, FrontierPoint
from thenar.compiler.frontier.price import fit_here
from thenar.compiler.frontier.search import Search
from thenar.compiler.frontier.survey import Cuts, choose_settings
from thenar.compiler.frontier.words import counted_of
from thenar.compiler.glove.propose import propose_harness
from thenar.compiler.model.collapse import collapse
from thenar.compiler.placement.elements import Element
from thenar.compiler.placement.methods.base import METHODS
from thenar.compiler.placement.placement import InputSelection
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.samples import Samples
from thenar.compiler.trainers.base import TRAINERS
from thenar.compiler.trainers.logitboost import boost
from thenar.compiler.wearer_study import study_wearers
from thenar.drivers.cyberglove_protocol import SENSORS_18
from thenar.runtime.model.quantise import quantise
from thenar.runtime.recipe import Recipe, changed
from thenar.runtime.scores import Scorer

from ..conftest import make_set, with_none

Rows = NDArray[np.intp]
Request = dict[str, Any]


pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", autouse=True)
def _timed_once() -> Iterator[None]:
    """Let this machine be timed once: how long that takes is no matter here."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(price, "fit_here", stored(1, here=True)(cache(fit_here)))
        yield


def asked(folder: Path, grasp_set: GraspSet, **changes: Any) -> Request:
    """Return arguments of find_frontier; `changes` are of its search or of itself."""
    search: dict[str, Any] = {
        "methods": ("elimination", "id3"),
        "rounds": 6,
        "trainer": "logitboost",
    }
    # Nothing is left to choose: no code has so many bins.
    search["settings"] = {"shrinkage": 1.0, "max_bins": 65536}
    search |= {"repeats": 1, "finalists": 2, "seed": 1, "by": None}
    search |= {name: changes.pop(name) for name in list(changes) if name in search}
    return {"grasp_set": grasp_set, "output": folder / "out", "search": Search(**search), "jobs": 1} | changes


def found_of(request: Request) -> Frontier:
    return find_frontier(**request)


def keys_in(store: Path) -> list[bytes]:
    with closing(sqlite3.connect(store)) as database:
        return [key for (key,) in database.execute("SELECT key FROM results")]


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> tuple[Request, Frontier]:
    request = asked(tmp_path_factory.mktemp("survey"), make_set(subjects=2))
    return request, found_of(request)


def test_a_frame_is_reading_on_lines_of_their_own_and_classifying(first: tuple[Request, Frontier]) -> None:
    for point in first[1].points:
        assert point.frame.us == pytest.approx(max(point.scan.us, point.transfer.us) + point.classify.us)


def test_a_rough_frontier_comes_before_what_is_refined(tmp_path: Path, first: tuple[Request, Frontier]) -> None:
    """It holds what was tried first, with the same rates, and is drawn in the folder."""
    seen = list[tuple[Frontier, set[str]]]()
    request = first[0] | {"output": tmp_path / "out"}
    found = find_frontier(
        **request, rough=lambda early: seen.append((early, {path.name for path in request["output"].iterdir()}))
    )
    ((early, names),) = seen
    assert (early.points, early.marks) == ((), ())
    assert early.tried == found.tried[: len(early.tried)]
    assert "frontier.svg" in names
    assert "frontier.json" not in names


def test_a_rough_frontier_of_sensors_counts_sensors(tmp_path: Path, first: tuple[Request, Frontier]) -> None:
    early = list[Frontier]()
    request = first[0] | {"output": tmp_path / "out", "search": replace_rows(first[0]["search"], sensors=2)}
    found = find_frontier(**request, rough=early.append)
    assert [counted_of(one) for one in (*early, found)] == ["sensors", "sensors"]


def test_rows_in_which_nothing_is_held_change_no_rate(tmp_path: Path, first: tuple[Request, Frontier]) -> None:
    more = with_none(first[0]["grasp_set"])
    found = found_of(first[0] | {"grasp_set": more, "output": tmp_path / "out"})
    assert found.fingerprint == more.fingerprint()
    assert [(one.placement, one.rate) for one in found.tried] == [(one.placement, one.rate) for one in first[1].tried]


def test_every_point_lies_on_a_front_without_dominating_others(first: tuple[Request, Frontier]) -> None:
    points = first[1].points
    assert points
    assert all(point.fronts for point in points)
    for name, cost in (("frame", lambda p: p.frame.us), ("switches", lambda p: len(p.switches))):
        front = [point for point in points if name in point.fronts]
        assert front
        assert not any(cost(a) < cost(b) and chosen_by(a) >= chosen_by(b) for a in front for b in front)


def chosen_by(point: FrontierPoint) -> float:
    """Return the rate before its correction."""
    return point.rate.mean + point.luck


def test_subjects_are_left_out_where_there_are_several(first: tuple[Request, Frontier]) -> None:
    found = first[1]
    assert (found.subjects, found.by, found.trials) == (2, "new subject", found.rows)
    rates = [point.rate for point in found.points] + [tried.rate for tried in found.tried]
    assert {rate.what for rate in (*rates, *(mark.rate for mark in found.marks))} == {"new subject, trials"}
    assert {point.other_rate and point.other_rate.what for point in found.points} == {"pooled, trials"}
    assert {point.rate.over for point in found.points} == {2}


def rows_recognised(grasp_set: GraspSet, point: FrontierPoint, train: Rows, test: Rows) -> int:
    """Choose, train and cut integers from some rows alone, and let the runtime answer the others."""
    setting, joints = point.setting, point.setting.inputs != "switches"
    labels = np.unique(grasp_set.labels, return_inverse=True)[1]
    codes = grasp_set.codes if joints else grasp_set.codes[:, :0]
    columns: tuple[int, ...] = ()
    if setting.inputs != "joints":
        beside = codes if setting.placement.method == "elimination" else codes[:, :0]
        learning = Samples(grasp_set.switches[train], beside[train], labels[train], tuple("0123"))
        columns = METHODS[setting.placement.method].chooser(learning)(setting.placement.parameter)
    bits = grasp_set.switches[:, list(columns)]
    X = np.hstack([bits.astype(np.uint16), codes])
    assert setting.rounds is not None
    stumps, _ = boost(X[train], labels[train], 4, rounds=setting.rounds)
    tables = collapse(stumps, len(columns))
    scorer = Scorer(quantise(tables, bits[train], codes[train], setting.width, setting.table_bits))
    answers = [scorer.biased_scores(bits[row], codes[row]) for row in test]
    return sum(lanes.index(max(lanes)) == labels[row] for lanes, row in zip(answers, test, strict=True))


def test_rates_are_those_of_rows_that_neither_placement_nor_training_saw(tmp_path: Path) -> None:
    """Stratified folds, and each subject from the others; all of it done here once more, one by one."""
    grasp_set = make_set(subjects=3)
    found = found_of(asked(tmp_path, grasp_set, repeats=2))
    labels = np.unique(grasp_set.labels, return_inverse=True)[1]
    for point in found.points:
        pooled = [rows_recognised(grasp_set, point, fold.train, fold.test) for fold in weka_folds(labels, 4, 1)]
        assert point.other_rate is not None
        assert point.other_rate.mean == pytest.approx(sum(pooled) / len(grasp_set))
        others = [np.flatnonzero(grasp_set.subjects == subject) for subject in ("S0", "S1", "S2")]
        alone = [
            rows_recognised(grasp_set, point, np.setdiff1d(np.arange(len(grasp_set)), test), test) for test in others
        ]
        assert chosen_by(point) == pytest.approx(sum(alone) / len(grasp_set))
        assert point.rate.correct == (sum(alone),)


def test_points_after_own_trials_are_those_that_evaluate_finds(tmp_path: Path) -> None:
    grasp_set = make_set(subjects=3)
    given = {"penalty": 1.0, "smoothness": 1.0}
    request = asked(tmp_path, grasp_set, own_trials=2, trainer="linear", settings=given)
    found = found_of(request)
    assert found.points
    table = [*csv.DictReader((tmp_path / "out" / "frontier.csv").read_text().splitlines())]
    for point, row in zip(found.points, table, strict=True):
        options = picked(tmp_path / "out" / "frontier.json", point.number, grasp_set).options
        rows = study_wearers(grasp_set, changed(Recipe(), options), (0, 2), 1).rows
        assert point.adapted is not None
        # All of the three have as many trials.
        for name, rate, study in zip(("before_adaptation", "after_adaptation"), point.adapted, rows, strict=True):
            assert rate.mean == pytest.approx(fmean(study.people)) == float(row[name])
            assert (rate.over, rate.total) == (3, 96 - 3 * 4 * 2)
    refusals: dict[str, dict[str, object]] = {
        "record two or more subjects": {"grasp_set": make_set()},
        "nobody has more than 8 trials of a type": {"own_trials": 8},
    }
    for reason, wrong in refusals.items():
        with pytest.raises(FrontierError, match=reason):
            found_of(request | wrong | {"output": tmp_path / "refused"})
    assert not (tmp_path / "refused").exists()


def test_frames_of_a_trial_are_on_one_side_of_every_fold(tmp_path: Path) -> None:
    """Every row ten times: with copies on both sides of a fold every rate would be 100 %, over 960 units."""
    grasp_set = make_set(subjects=2)
    request = {"methods": ("id3",), "by": "trial"}
    repeated = found_of(asked(tmp_path / "ten", grasp_set.rows(np.repeat(np.arange(96), 10)), **request))
    assert (repeated.rows, repeated.trials, repeated.by) == (960, 96, "pooled")
    assert repeated.points
    for point in repeated.points:
        assert point.frames is not None
        assert (point.rate.total, point.frames.total, point.frames.what) == (96, 960, "pooled, frames")
        # Equal frames of a trial are recognised together.
        assert point.frames.mean == pytest.approx(chosen_by(point))
        assert point.frames.over == 96
        assert point.rate.mean < 1


def test_without_a_folder_nothing_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert found_of(asked(tmp_path, make_set(), output=None, methods=("id3",))).points
    assert not list(tmp_path.iterdir())


def test_a_run_that_is_interrupted_goes_on_without_repeating_anything(tmp_path: Path) -> None:
    request = asked(tmp_path, make_set())
    store, counts = request["output"] / "store.sqlite", [0]

    for _ in range(3):
        told = iter(range(45))

        def report(_done: int, _total: int, told: Iterator[int] = told) -> None:
            if next(told, None) is None:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            found_of({**request, "report": report})
        counts.append(len(keys_in(store)))
    assert counts == sorted(set(counts))
    assert found_of(request).points


def test_progress_grows_to_its_end(tmp_path: Path) -> None:
    told = list[tuple[int, int]]()
    grasp_set = make_set(rows=400, subjects=3)
    found_of(asked(tmp_path, grasp_set, own_trials=1, report=lambda done, total: told.append((done, total))))
    assert len({total for _, total in told}) == 1
    assert told == sorted(told)
    assert told[-1][0] == told[-1][1]


@pytest.mark.parametrize(
    ("switches", "joints", "inputs"),
    [(14, 0, {"switches"}), (0, 3, {"joints"}), (1, 2, {"both", "switches", "joints"})],
)
def test_a_set_may_lack_switches_or_joints(tmp_path: Path, switches: int, joints: int, inputs: set[str]) -> None:
    found = found_of(asked(tmp_path, make_set(switches=switches, joints=joints)))
    assert {each.inputs for each in found.tried} == inputs
    assert found.points
    assert (found.by, found.other) == ("pooled", None)
    assert all(point.other_rate is None for point in found.points)
    if joints == 0:
        assert "paper, S = 62" in [mark.name for mark in found.marks]


def test_what_ports_cost_is_part_of_the_question(tmp_path: Path) -> None:
    methods = ("id3-cost",)
    request = asked(tmp_path, make_set(), methods=methods)
    names = [f"s{number}" for number in range(14)]
    glove = propose_harness(names[::-1], "pca9555")
    alone = found_of({**request, "output": tmp_path / "alone", "harness": glove})
    found_of(request)
    after = found_of({**request, "harness": glove})
    assert [(each.placement, each.n_switches, each.rate) for each in after.tried] == [
        (each.placement, each.n_switches, each.rate) for each in alone.tried
    ]
    assert len(keys_in(tmp_path / "out" / "store.sqlite")) > len(keys_in(tmp_path / "alone" / "store.sqlite"))


def test_a_search_that_is_refused_leaves_no_folder_and_no_file(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    for folder in (tmp_path / "not" / "there", tmp_path):
        with pytest.raises(FrontierError, match="there is no target 'nonsense'"):
            found_of(asked(folder, make_set(), target="nonsense"))
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert list((tmp_path / "out").iterdir()) == []


def test_compile_makes_what_a_point_of_each_trainer_says(tmp_path: Path) -> None:
    request = asked(tmp_path, make_set(subjects=2), methods=("id3",), trainer="auto", settings={})
    found = found_of(request)
    assert set(found.trainers) == {"logitboost", *(name for name, trainer in TRAINERS.items() if trainer.automatic)}
    drawn = (tmp_path / "out" / "frontier.svg").read_text()
    # Outlines: but each trainer has a line in the key, and the file another size than with one trainer.
    assert drawn != picture(replace(found, tried=found.tried[:1]), "svg").decode()
    tried = {
        name: {(one.placement, one.inputs) for one in found.tried if one.trainer == name} for name in found.trainers
    }
    assert tried["linear"] <= tried["logitboost"]
    assert tried["linear"]
    path = tmp_path / "out" / "frontier.json"
    for name in found.trainers:
        points = [point for point in found.points if point.setting.trainer == name]
        for point in points[:1]:
            chosen = picked(path, point.number, request["grasp_set"])
            options: dict[str, Any] = dict(chosen.options)
            made = compile_build(
                request["grasp_set"], tmp_path / name, folds=0, harness=chosen.wired(None), jobs=1, **options
            )
            fit = made.manifest.fit
            # Nothing was left to choose.
            assert (fit.trainer, fit.compared) == (name, ())
            given = {own: value for own, value in fit.settings.items() if value is not None}
            assert point.setting.settings.items() <= given.items()
            assert made.tables.n_switches == len(point.switches)


def test_settings_are_chosen_inside_the_training_rows() -> None:
    samples = Samples.of(make_set(subjects=2))
    cuts, candidates = Cuts.of(samples, Search()), Search().alone("logit").candidates
    fold = cuts.screening[0]
    kept = InputSelection.of(tuple(map(Element, range(3))), (0, 1, 2))
    found = choose_settings(samples, fold.train, kept, candidates, 1, True)
    shuffled = samples.labels.copy()
    shuffled[fold.test] = shuffled[fold.test][::-1]
    assert choose_settings(replace_rows(samples, labels=shuffled), fold.train, kept, candidates, 1, True) == found


def with_sensors(grasp_set: GraspSet, sensors: int) -> GraspSet:
    """Return the set with joints of a CyberGlove: its own, again and again, each with more noise."""
    random, n = np.random.default_rng(3), len(grasp_set.joints)
    columns = [number % n for number in range(sensors)]
    noise = random.integers(0, 1 + 12 * np.arange(sensors), (len(grasp_set), sensors))
    codes = np.clip(grasp_set.codes[:, columns].astype(int) + noise, 1, 255).astype(np.uint16)
    joints = tuple(replace_rows(grasp_set.joints[n], name=name) for n, name in zip(columns, SENSORS_18, strict=False))
    return replace_rows(grasp_set, codes=codes, joints=joints)


def test_builds_of_points_with_some_joints_read_these_joints(tmp_path: Path) -> None:
    grasp_set = with_sensors(make_set(switches=3, subjects=2), 5)
    found = found_of(asked(tmp_path, grasp_set, finalists=6, methods=("elimination",)))
    fewer = [point for point in found.points if point.joints]
    assert fewer
    for point in found.points:
        n = len(point.joints) if point.joints else 0 if point.setting.inputs == "switches" else 5
        assert point.setting.keep_joints == (len(point.joints) or None)
        assert set(point.joints) <= {joint.name for joint in grasp_set.joints}
        if n:
            assert point.transfer.us == pytest.approx(250 * n + (n + 3) * 10e6 / 115_200)
            assert point.transfer.how == "formula"
    assert {each.keep_joints for each in found.tried} == {None, 2, 3, 4}
    chosen = picked(tmp_path / "out" / "frontier.json", fewer[0].number, grasp_set)
    options: dict[str, Any] = dict(chosen.options)
    made = compile_build(grasp_set, tmp_path / "build", folds=0, harness=chosen.wired(None), jobs=1, **options)
    assert tuple(joint.name for joint in made.manifest.joints) == fewer[0].joints
