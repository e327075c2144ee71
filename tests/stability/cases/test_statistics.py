import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from thenar.compiler.evaluation.folds import block_folds, leave_one_out, weka_folds
from thenar.compiler.evaluation.rates import Rate, clustered
from thenar.compiler.evaluation.study import Options, evaluate
from thenar.stability.cases.statistics import WILSON_BOUND, lopsided
from thenar.stability.inputs.small_sets import make_set
from thenar.stability.reference.intervals import wilson
from thenar.stability.reference.numbers import distance


@given(st.integers(1, 10**15), st.floats(0, 1))
@example(1, 0.0)
@example(1, 1.0)
@example(10**15, 1.0)
def test_an_interval_is_wilsons_to_the_last_places(total: int, share: float) -> None:
    correct = min(int(share * total), total)
    rate = Rate.counted((correct,), total, of="pooled")
    low, high = wilson(correct, total)
    assert max(distance(rate.low, low), distance(rate.high, high)) <= WILSON_BOUND
    assert 0 <= rate.low <= rate.mean <= rate.high <= 1
    assert rate.low < rate.high


@pytest.mark.parametrize("total", [1, 2, 12, 1000, 10**12])
@pytest.mark.parametrize("repeats", [1, 2, 5])
def test_nothing_or_everything_recognised_ends_the_interval_there_and_leaves_it_wide(total: int, repeats: int) -> None:
    none, everything = (Rate.counted((each,) * repeats, total, of="pooled") for each in (0, total))
    assert none.low == 0 < none.high
    assert everything.low < 1 == everything.high
    # What holds of the one holds of the other, turned round.
    assert none.high == pytest.approx(1 - everything.low, abs=4 * WILSON_BOUND)
    assert none.high == pytest.approx(float(wilson(0, total)[1]), abs=WILSON_BOUND)


@pytest.mark.parametrize("sizes", [[1] * 12, [12], [5, 5, 2], [200] * 7, [1, 999]])
def test_clusters_of_nothing_but_misses_or_hits_end_there(sizes: list[int]) -> None:
    none, everything = clustered([0] * len(sizes), sizes, "trials"), clustered(sizes, sizes, "trials")
    assert none[0] == pytest.approx(0, abs=WILSON_BOUND)
    assert everything[1] == pytest.approx(1, abs=WILSON_BOUND)
    assert none[1] == pytest.approx(1 - everything[0], abs=4 * WILSON_BOUND)
    assert none[1] >= float(wilson(0, sum(sizes))[1]) - WILSON_BOUND


@settings(deadline=None)
@given(st.lists(st.integers(0, 4), min_size=2, max_size=40), st.integers(2, 12), st.integers(0, 100))
@example([0, 0, 0, 0, 1], 4, 1)
@example([0, 1, 2, 3], 4, 1)
def test_classes_smaller_than_the_folds_are_tested_once_a_row_and_spread(
    labels: list[int], n_folds: int, seed: int
) -> None:
    if n_folds > len(labels):
        with pytest.raises(ValueError, match="cannot be cut into"):
            weka_folds(labels, n_folds, seed)
        return
    folds = weka_folds(labels, n_folds, seed)
    assert sorted(row for fold in folds for row in fold.test.tolist()) == list(range(len(labels)))
    for fold in folds:
        assert sorted([*fold.test.tolist(), *fold.train.tolist()]) == list(range(len(labels)))
        assert len(fold.train)
    for label in set(labels):
        tested = [sum(labels[row] == label for row in fold.test) for fold in folds]
        assert max(tested) - min(tested) <= 1
    sizes = [len(fold.test) for fold in folds]
    assert max(sizes) - min(sizes) <= 1


@given(st.lists(st.sampled_from("ABC"), min_size=2, max_size=20), st.lists(st.integers(0, 6), min_size=2, max_size=20))
def test_groups_and_blocks_are_whole_on_one_side(names: list[str], trials: list[int]) -> None:
    if len(set(names)) > 1:
        groups = np.array(names)
        for fold in leave_one_out(groups, "subject"):
            assert not set(groups[fold.train]) & set(groups[fold.test])
            assert len(fold.train) + len(fold.test) == len(names)
    if len(set(trials)) > 2:
        numbers = np.array(trials)
        for fold in block_folds(numbers, 3):
            assert not set(numbers[fold.train]) & set(numbers[fold.test])
            assert len(fold.train)
            assert len(fold.test)


@pytest.mark.parametrize("name", lopsided())
def test_what_one_side_lacks_is_said_and_counted_as_wrong(name: str) -> None:
    grasp_set, scheme = lopsided()[name]
    options = Options(scheme=scheme, rounds=5, repeats=2, tables=("compositions",))
    study = evaluate(grasp_set, options, jobs=1)
    lost = [warning for warning in study.warnings if "they cannot be recognised" in warning]
    assert lost
    rows = sum(int(warning.split(" row(s)", 1)[0]) for warning in lost)
    for table in study.tables:
        for row in table.rows:
            repeats = len(row.cells[0].rate.correct)
            wrong = sum(repeats * cell.rate.total - sum(cell.rate.correct) for cell in row.cells)
            assert wrong >= rows


def test_subjects_of_one_class_each_recognise_nothing_of_each_other() -> None:
    grasp_set, scheme = lopsided()["subjects of one class each"]
    study = evaluate(grasp_set, Options(scheme=scheme, rounds=5), jobs=1)
    for table in study.tables:
        for row in table.rows:
            assert [cell.rate.correct[0] for cell in row.cells] == [0, 0]
            assert row.rate.low == 0 < row.rate.high


def test_a_subject_of_one_row_is_left_out_and_cannot_be_cut_into_folds() -> None:
    frames = [[0, 0], [0, 1], [1, 0], [1, 1]] * 2 + [[0, 0]]
    grasp_set = make_set(["a", "b"] * 4 + ["a"], frames, subjects=["A"] * 8 + ["B"])
    study = evaluate(grasp_set, Options(scheme="subject", rounds=5, tables=("compositions",)), jobs=1)
    assert study.tables[0].columns == ("A", "B")
    assert [cell.rate.total for cell in study.tables[0].rows[0].cells] == [8, 1]
    with pytest.raises(ValueError, match="subject B: 1 rows cannot be cut into 4 folds"):
        evaluate(grasp_set, Options(rounds=5), jobs=1)


def test_a_class_that_every_second_repeat_could_miss_is_in_each_confusion_matrix() -> None:
    grasp_set = make_set(["a"] * 7 + ["b"], [[0]] * 7 + [[1]])
    study = evaluate(grasp_set, Options(rounds=5, repeats=3, tables=("compositions",)), jobs=1)
    for table in study.tables:
        for row in table.rows:
            confusion = np.array(row.cells[0].confusion)
            assert confusion.sum(axis=1).tolist() == [21, 3]
            # The only b is tested by a fold that has never seen one.
            assert confusion[1, 1] == 0
