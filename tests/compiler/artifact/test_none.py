"""Builds that know that nothing is held: none as a class of the tables, and frames that are refused without one."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from thenar.compiler import Build, GraspSet, adapt, compile_build, verify
from thenar.compiler.artifact import CompileError
from thenar.compiler.artifact.training import cuts_of, samples_of
from thenar.compiler.evaluation.choosing import inner_folds
from thenar.compiler.recogniser import Recogniser
from thenar.compiler.recordings.graspset import Joint
from thenar.compiler.recordings.merging import merge
from thenar.compiler.recordings.taxonomy import own
from thenar.compiler.samples import FRAMES as SAMPLED
from thenar.compiler.samples import Samples, select_inputs
from thenar.runtime.manifest import Rejection
from thenar.runtime.recipe import Recipe
from thenar.runtime.scores import refused

from ...sets import grasp_set_of

TYPES, TRIALS, FRAMES = ("pinch", "hook", "disk"), 20, 4


def moving(subjects: int = 3) -> GraspSet:
    """Return movements: each grasp with frames before it and after it in which few switches are closed."""
    random, rows = np.random.default_rng(5), []
    for subject in range(subjects):
        for trial in range(TRIALS):
            for label in range(len(TYPES)):
                for frame in range(3 * FRAMES):
                    held = FRAMES <= frame < 2 * FRAMES
                    closed = random.random(9) < np.where(np.arange(9) // 3 == label, 0.9, 0.05) * (held or 0.1)
                    codes = np.asarray(random.normal(100 + 30 * (label == np.arange(3)) * held, 6)).astype(np.uint16)
                    rows.append((closed, codes, label if held else len(TYPES), f"S{subject}", trial))
    switches, codes, labels, people, trials = (np.array(column) for column in zip(*rows, strict=True))
    return grasp_set_of(
        TYPES,
        labels,
        switches=switches,
        codes=codes,
        joints=tuple(Joint(f"j{number}", "raw", 0, 0.0, 255, 255.0) for number in range(3)),
        subjects=people,
        objects=np.repeat([f"of {TYPES[label]}" for label in labels[FRAMES :: 3 * FRAMES]], 3 * FRAMES),
        trials=trials,
    )


@pytest.fixture(scope="module")
def moved() -> GraspSet:
    return moving()


def test_none_is_the_last_class_and_placed_on_grasps_alone(moved: GraspSet, tmp_path: Path) -> None:
    made = compile_build(moved, tmp_path / "build", rounds=20, folds=3, keep=4, placement="cmim", jobs=1)
    without = compile_build(moved.without_none(), tmp_path / "without", rounds=20, folds=0, keep=4, placement="cmim")
    assert made.manifest.grasps == (*sorted(TYPES, key=TYPES.index), "none")
    assert [each.name for each in made.manifest.switches] == [each.name for each in without.manifest.switches]
    assert made.manifest.rejection is None
    assert Build.load(tmp_path / "build").none == 3
    *rates, adapted = made.manifest.rates
    assert all(rate.total in (180, 720) for rate in rates)
    assert (adapted.of, adapted.total) == ("new subject after adaptation", 162)
    found = made.manifest.detected
    assert found is not None
    assert found.none is not None
    assert found.held.of == "new subject"
    assert found.held.rate > 0.9
    assert found.none.rate > 0.9
    assert made.confusion is not None
    assert made.confusion.shape == (4, 4)
    assert made.confusion.sum() == len(moved)
    assert verify(tmp_path / "build", moved).holds


def test_no_fold_parts_a_movement(moved: GraspSet) -> None:
    samples, ids = samples_of(moved, Recipe()), moved.movement_ids
    folds = [fold for cut in cuts_of(moved, Recipe()) for fold in cut.folds] + inner_folds(samples, 1)
    assert len(np.unique(ids)) == 180
    for fold in folds:
        assert not set(ids[fold.train]) & set(ids[fold.test])
    # Stratified by the grasp: every pooled fold tests as many movements of each type.
    for fold in inner_folds(samples, 1):
        types = samples.labels[fold.test][samples.labels[fold.test] < 3]
        assert np.ptp(np.bincount(types)) <= FRAMES


def test_no_more_rows_of_nothing_held_than_of_grasps_are_trained_on(moved: GraspSet) -> None:
    samples = Samples.of(moved)
    rows = samples.balanced()
    assert (np.diff(rows) > 0).all()
    assert np.count_nonzero(samples.is_none[rows]) == np.count_nonzero(~samples.is_none) == 720
    assert np.array_equal(samples.without_none().balanced(), np.arange(720))


@given(st.lists(st.tuples(st.integers(0, 90), st.integers(0, 90)).filter(any), min_size=1, max_size=6))
def test_of_a_long_movement_some_frames_are_trained_on(parts: list[tuple[int, int]]) -> None:
    labels = np.concatenate([np.repeat([0, 1], part) for part in parts])
    movements = np.repeat(np.arange(len(parts)), [sum(part) for part in parts])
    samples = Samples(labels[:, None] > 0, np.zeros((len(labels), 0), np.uint16), labels, ("a", "none"))
    rows = replace(samples, movements=movements, has_none=True).balanced()
    assert (np.diff(rows) > 0).all()
    held, none = np.bincount(labels, minlength=2)
    for movement, size in enumerate(np.bincount(movements)):
        own = rows[movements[rows] == movement]
        assert len(own) <= SAMPLED
        if none <= held:
            assert len(own) == min(size, SAMPLED)
            assert np.ptp(np.diff(own)) <= 1 if len(own) > 1 else True


def test_without_rows_of_none_the_requested_share_is_refused(moved: GraspSet, tmp_path: Path) -> None:
    held = moved.without_none()
    made = compile_build(held, tmp_path / "build", rounds=20, folds=3, refuse=0.02, jobs=1)
    build, found = Build.load(tmp_path / "build"), made.manifest.detected
    assert build.none is None
    assert build.scorer.rejector is not None
    assert made.manifest.rejection is not None
    assert found is not None
    assert found.none is None
    assert found.held.rate >= 0.95
    assert made.manifest.classes == (*TYPES, "none")
    bits, codes = select_inputs(moved, made.manifest)
    scores = build.tables.scores(bits, codes)
    gone = refused(made.manifest.rejection, scores, bits, codes)
    assert gone[~moved.is_none].mean() <= 0.02
    assert gone[moved.is_none].mean() >= 0.5
    lost = build.scorer.biased_scores(bits[0], codes[0])
    assert build.scorer.rejector.refuses(lost, int(bits[0].sum()), 0, codes[0].tolist()) == gone[0]


def test_frames_are_refused_by_how_far_whole_groups_deviate(moved: GraspSet) -> None:
    held = moved.without_none()
    asked = Recipe(rounds=20, folds=0, refuse=0.02)
    samples = samples_of(held, asked)

    def rejection(groups: NDArray[np.str_] | None) -> Rejection | None:
        return Recogniser.fit(samples, asked, groups=groups).rejection

    people = np.asarray(held.subjects)
    one, two = np.full(len(held), "S0"), np.where(people == "S2", "S1", people)
    assert rejection(one) is None
    # Trials say less: two groups are left out in turn, as three are.
    assert rejection(two) != rejection(None) is not None


def test_without_refusal_the_firmware_says_nothing_of_it(moved: GraspSet, tmp_path: Path) -> None:
    held = moved.without_none()
    for refuse in (0.0, 0.01):
        compile_build(held, tmp_path / f"{refuse}", rounds=5, folds=0, refuse=refuse, jobs=1)
    header, tables = (
        [(tmp_path / f"{refuse}" / "firmware" / f"thenar_glove{end}").read_text() for refuse in (0.0, 0.01)]
        for end in (".h", ".c")
    )
    assert ["THENAR_GLOVE_NONE 3u" in text for text in header] == [False, True]
    assert [".rejection = &rejection" in text for text in tables] == [False, True]
    assert Build.load(tmp_path / "0.0").scorer.rejector is None


def test_compiled_classifiers_refuse_the_frames_that_python_does(moved: GraspSet, tmp_path: Path) -> None:
    compile_build(moved.without_none(), tmp_path / "build", rounds=20, folds=0, refuse=0.05, jobs=1)
    found = verify(tmp_path / "build", moved.without_none(), firmware=["host"]).firmware
    assert found is not None
    assert found.holds


@pytest.fixture(scope="module")
def mixed(moved: GraspSet) -> GraspSet:
    """Movements of one subject, and static grasps of two others."""
    held = np.flatnonzero(~moved.is_none & (moved.subjects != "S0"))
    alone = moved.rows(held[np.unique(moved.trial_ids[held], return_index=True)[1]])
    return merge({"movements": moved.rows(moved.subjects == "S0"), "static": alone})


def test_static_grasps_teach_types_and_not_whether_something_is_held(mixed: GraspSet, tmp_path: Path) -> None:
    samples = Samples.of(mixed)
    options = Recipe(trainer="logit", keep=6, placement="cmim", folds=3, settings={"penalty": 1.0, "smoothness": 2.0})
    assert (samples.silent == (mixed.subjects != "S0")).all()
    assert not Samples.of(mixed.rows(mixed.subjects == "S0")).silent.any()
    assert samples.rows(~samples.is_none).given_held is None
    report = compile_build(mixed, tmp_path / "build", options, jobs=1)
    crowd = report.manifest.segments
    assert crowd is not None
    # The wearer's evidence weighs as much, whatever a step of the new tables is worth: here of one with other habits.
    other = mixed.rows((mixed.subjects == "S0") & (mixed.trials < 6))
    turned = dict(zip((*TYPES, "none"), (*TYPES[1:], TYPES[0], "none"), strict=True))
    habits = replace(other, grasps=np.array([*map(turned.get, other.grasps)]))
    adapt(tmp_path / "build", habits, output=tmp_path / "mine")
    mine = Build.load(tmp_path / "mine")
    assert mine.manifest.segments is not None
    assert mine.tables.scale != report.tables.scale
    weights = [
        each.gain / 2.0**each.shift * scale
        for each, scale in ((crowd, report.tables.scale), (mine.manifest.segments, mine.tables.scale))
    ]
    assert weights[1] == pytest.approx(weights[0], rel=0.01)
    # Who is tested on the only subject with movements has not learnt what an empty hand is like: that is not counted.
    new, pooled = (
        next(each for each in report.manifest.detection if each.held.of == of and each.held.protocol == "nested")
        for of in ("new subject", "pooled")
    )
    assert (new.held.total, new.none) == (2 * 3 * TRIALS, None)
    assert pooled.none is not None
    assert pooled.none.correct > 0.8 * pooled.none.total
    assert report.confusion is not None
    assert report.confusion.sum() == 2 * 3 * TRIALS


@pytest.mark.parametrize("share", [-0.1, 0.5])
def test_a_share_that_makes_no_sense_is_an_error(moved: GraspSet, tmp_path: Path, share: float) -> None:
    with pytest.raises(CompileError, match="give a share of grasps"):
        compile_build(moved, tmp_path / "build", refuse=share)


def test_a_custom_type_called_none_is_an_ordinary_type(moved: GraspSet) -> None:
    old = replace(moved, taxonomy=own((*TYPES, "none")))
    samples = Samples.of(old)
    assert not samples.has_none
    assert samples.n_types == 4
