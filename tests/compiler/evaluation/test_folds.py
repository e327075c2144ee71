from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.evaluation.folds import (
    EvaluationError,
    Fold,
    JavaRandom,
    leave_one_out,
    trial_folds,
    weka_folds,
)

seeds = st.integers(-(2**63), 2**63 - 1)


def test_seed_42_gives_the_well_known_first_numbers() -> None:
    random = JavaRandom(42)
    assert [random.next_int(10) for _ in range(10)] == [0, 3, 8, 4, 0, 5, 5, 8, 9, 3]


def test_the_first_32_bits_of_seed_0_are_javas() -> None:
    # new Random(0).nextInt() is -1155484576.
    assert JavaRandom(0).next_bits(32) - (1 << 32) == -1155484576


def test_a_draw_from_the_incomplete_last_run_is_thrown_away() -> None:
    # With this bound nearly half of all draws fall into the incomplete run; the accepted ones are the draws themselves.
    bound = (1 << 30) + 1
    random, raw = JavaRandom(7), JavaRandom(7)
    drawn = [random.next_int(bound) for _ in range(50)]
    accepted = [number for number in (raw.next_bits(31) for _ in range(400)) if number < bound]
    assert drawn == accepted[:50]


@pytest.mark.parametrize("bound", [0, -1, 2**31])
def test_a_bound_that_java_refuses_is_refused(bound: int) -> None:
    with pytest.raises(ValueError, match="bound"):
        JavaRandom(1).next_int(bound)


@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 3)), min_size=2, max_size=60), seeds, st.integers(2, 5))
def test_folds_keep_trials_whole_and_cut_them_as_weka(frames: list[tuple[int, int]], seed: int, n_folds: int) -> None:
    """The label of a frame is a part of its trial's name."""
    names = list(dict.fromkeys(frames))
    trials, labels = np.array([names.index(frame) for frame in frames]), np.array([label for _, label in frames])
    if len(names) < n_folds:
        with pytest.raises(EvaluationError, match="cannot be cut"):
            trial_folds(labels, trials, n_folds, seed)
        return
    expected = weka_folds([label for _, label in names], n_folds, seed)
    for fold, of_trials in zip(trial_folds(labels, trials, n_folds, seed), expected, strict=True):
        for rows, chosen in ((fold.train, of_trials.train), (fold.test, of_trials.test)):
            assert rows.tolist() == [row for trial in chosen for row in np.flatnonzero(trials == trial)]


GOLDENS = ("bin3", "bin14nom", "dupfeat", "missing", "twoclass", "separable", "rare", "paper14")


@pytest.mark.parametrize("name", GOLDENS)
@pytest.mark.parametrize("mode", ["default", "strict"])
def test_folds_and_training_orders_are_wekas(weka_data: Path, name: str, mode: str) -> None:
    with np.load(weka_data / "open" / f"{name}.npz") as golden:
        labels = golden["y"]
        fold_of_row = golden[f"{mode}/I100/cv/fold"]
        orders = golden[f"{mode}/I100/cv/train_order"]
    folds = weka_folds(labels, 4, seed=1)
    assert len(folds) == 4
    for number, fold in enumerate(folds):
        assert np.array_equal(np.sort(fold.test), np.flatnonzero(fold_of_row == number))
        assert np.array_equal(fold.train, orders[number][orders[number] >= 0])


def covers_once(folds: list[Fold], n: int) -> bool:
    tested = np.sort(np.concatenate([fold.test for fold in folds]))
    whole = all(np.array_equal(np.sort(np.concatenate([fold.train, fold.test])), np.arange(n)) for fold in folds)
    return whole and np.array_equal(tested, np.arange(n))


labelled = st.lists(st.integers(0, 5), min_size=2, max_size=80)


@given(labelled, st.data())
def test_every_row_is_tested_once_and_never_where_it_was_trained(labels: list[int], data: st.DataObject) -> None:
    n_folds = data.draw(st.integers(2, len(labels)))
    folds = weka_folds(labels, n_folds, data.draw(st.integers(0, 1000)))
    assert covers_once(folds, len(labels))


@pytest.mark.parametrize(
    ("n_rows", "n_folds", "reason"),
    [(3, 4, "3 rows cannot be cut into 4 folds"), (5, 1, "1 fold"), (0, 4, "0 rows")],
)
def test_a_cut_that_leaves_nothing_is_refused_with_the_reason(n_rows: int, n_folds: int, reason: str) -> None:
    with pytest.raises(EvaluationError, match=reason):
        weka_folds([0] * n_rows, n_folds, 1)


@given(st.lists(st.sampled_from("ABCDE"), min_size=2, max_size=40).filter(lambda names: len(set(names)) > 1))
def test_each_fold_tests_exactly_one_group(names: list[str]) -> None:
    groups = np.array(names)
    folds = leave_one_out(groups, "subject")
    assert [fold.name for fold in folds] == sorted(set(names))
    assert covers_once(folds, len(names))
    for fold in folds:
        assert set(groups[fold.test]) == {fold.name}
        assert fold.name not in groups[fold.train]
