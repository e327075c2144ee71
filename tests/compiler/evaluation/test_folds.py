from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.evaluation.errors import EvaluationError
from thenar.compiler.evaluation.folds import weka_folds

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


labelled = st.lists(st.integers(0, 5), min_size=2, max_size=80)


@given(labelled, st.data())
def test_every_row_is_tested_once_and_never_where_it_was_trained(labels: list[int], data: st.DataObject) -> None:
    n_folds = data.draw(st.integers(2, len(labels)))
    folds = weka_folds(labels, n_folds, data.draw(st.integers(0, 1000)))
    everything = np.arange(len(labels))
    assert np.array_equal(np.sort(np.concatenate([fold.test for fold in folds])), everything)
    for fold in folds:
        assert np.array_equal(np.sort(np.concatenate([fold.train, fold.test])), everything)


@given(labelled, st.data())
def test_every_class_is_spread_evenly(labels: list[int], data: st.DataObject) -> None:
    n_folds = data.draw(st.integers(2, len(labels)))
    folds = weka_folds(labels, n_folds, seed=data.draw(st.integers(0, 1000)))
    counts = np.array([np.bincount(np.asarray(labels)[fold.test], minlength=6) for fold in folds])
    assert (np.ptp(counts, axis=0) <= 1).all()


def test_another_seed_cuts_otherwise() -> None:
    labels = np.repeat([0, 1], 20)
    assert not np.array_equal(weka_folds(labels, 4, 1)[0].train, weka_folds(labels, 4, 2)[0].train)


def test_a_fold_of_a_part_speaks_of_the_rows_of_the_whole() -> None:
    part = np.array([3, 5, 8, 13])
    fold = weka_folds([0, 0, 1, 1], 2, 1)[0].of(part)
    assert sorted([*fold.train, *fold.test]) == [3, 5, 8, 13]


@pytest.mark.parametrize(
    ("n_rows", "n_folds", "reason"),
    [(3, 4, "3 rows cannot be cut into 4 folds"), (5, 1, "1 fold"), (0, 4, "0 rows")],
)
def test_a_cut_that_leaves_nothing_is_refused_with_the_reason(n_rows: int, n_folds: int, reason: str) -> None:
    with pytest.raises(EvaluationError, match=reason):
        weka_folds([0] * n_rows, n_folds, 1)
