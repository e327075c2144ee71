import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.evaluation.errors import EvaluationError
from thenar.compiler.evaluation.folds import Fold
from thenar.compiler.evaluation.groups import block_folds, leave_one_out

trial_numbers = st.lists(st.integers(-5, 30), min_size=2, max_size=60)


def covers_once(folds: list[Fold], n: int) -> bool:
    tested = np.sort(np.concatenate([fold.test for fold in folds]))
    whole = all(np.array_equal(np.sort(np.concatenate([fold.train, fold.test])), np.arange(n)) for fold in folds)
    return whole and np.array_equal(tested, np.arange(n))


@given(st.lists(st.sampled_from("ABCDE"), min_size=2, max_size=40).filter(lambda names: len(set(names)) > 1))
def test_each_fold_tests_exactly_one_group(names: list[str]) -> None:
    groups = np.array(names)
    folds = leave_one_out(groups, "subject")
    assert [fold.name for fold in folds] == sorted(set(names))
    assert covers_once(folds, len(names))
    for fold in folds:
        assert set(groups[fold.test]) == {fold.name}
        assert fold.name not in groups[fold.train]


@given(trial_numbers, st.data())
def test_blocks_are_contiguous_in_trial_number_and_never_split_one(trials: list[int], data: st.DataObject) -> None:
    numbers = np.array(trials)
    distinct = len(np.unique(numbers))
    if distinct < 2:
        return
    folds = block_folds(numbers, data.draw(st.integers(2, distinct)))
    assert covers_once(folds, len(trials))
    for earlier, later in itertools.pairwise(folds):
        assert numbers[earlier.test].max() < numbers[later.test].min()


def test_a_block_is_named_by_its_trials() -> None:
    assert [fold.name for fold in block_folds(np.array([1, 2, 3, 1]), 2)] == ["trials 1-2", "trial 3"]


def test_a_single_group_cannot_be_left_out() -> None:
    with pytest.raises(
        EvaluationError, match="leaving one object out needs two or more; all 3 rows are of object 'cup'"
    ):
        leave_one_out(np.array(["cup"] * 3), "object")


def test_rows_of_one_trial_number_have_no_blocks() -> None:
    with pytest.raises(EvaluationError, match="all 5 rows have trial number 7"):
        block_folds(np.full(5, 7), 2)


def test_fewer_trial_numbers_than_folds_are_refused() -> None:
    with pytest.raises(EvaluationError, match="3 trial numbers cannot be cut into 4 folds"):
        block_folds(np.array([1, 2, 3, 3, 3]), 4)
