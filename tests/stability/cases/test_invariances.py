"""What says the same must be learnt as the same: exactly, or within a derived bound until stumps tie."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from thenar.compiler.boosting.boost import boost
from thenar.compiler.boosting.classifier import LogitBoostClassifier
from thenar.compiler.placement.id3 import grow_id3
from thenar.compiler.placement.tree import Tree
from thenar.stability.cases import invariances as changes
from thenar.stability.cases.invariances import Change, Followed, Partings, learn, numbers, renumbered
from thenar.stability.checks.rounds import counted
from thenar.stability.inputs.hard_data import HardSet, intervals

Change_ = Callable[[HardSet, np.random.Generator], Change]


@st.composite
def hard_sets(draw: st.DrawFn, classes: st.SearchStrategy[int]) -> HardSet:
    """Switches and joints of any number, equal and complementary columns, ties and contradictions among them."""
    n, k = draw(st.integers(2, 16)), draw(classes)
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    switches = rng.integers(0, 2, (n, draw(st.integers(0, 4))))
    if switches.shape[1] and draw(st.booleans()):
        switches = np.column_stack([switches, 1 - switches[:, 0], switches[:, 0]])
    joints = rng.integers(0, draw(st.sampled_from([2, 3, 9, 65536])), (n, draw(st.integers(0, 2))))
    X = np.column_stack([switches, joints]).astype(np.int64)
    assume(bool((X[:1] != X).any()))
    return HardSet("drawn", X, rng.integers(0, k, n).astype(np.intp), k, switches.shape[1])


EXACT: dict[str, Change_] = {
    "rows permuted": changes.rows_in_another_order,
    "constant columns": lambda hard, _: changes.constant_columns(hard),
    "codes recoded": changes.codes_recoded,
    "weights scaled": lambda hard, rng: changes.weights_scaled(hard, int(rng.integers(-1000, 1000))),
    "columns copied": lambda hard, _: changes.copied_columns(hard),
}


def assert_same(hard: HardSet, change: Change) -> None:
    """Assert that every number learnt is the same, bit for bit, in the numbering of the set as it was."""
    inputs, classes = range(hard.X.shape[1]), range(hard.n_classes)
    before = numbers(learn(hard, rounds=15), inputs, classes)
    after = numbers(learn(change.hard, rounds=15), change.inputs, change.classes)
    for (name, one), (_, other) in zip(before, after, strict=True):
        np.testing.assert_array_equal(one, other, err_msg=f"{change.name}: {name}")


@pytest.mark.parametrize("change_of", EXACT.values(), ids=EXACT.keys())
@given(hard=hard_sets(st.integers(2, 5)), seed=st.integers(0, 2**32))
@settings(max_examples=12, deadline=None)
def test_nothing_that_is_learnt_changes_in_any_bit(change_of: Change_, hard: HardSet, seed: int) -> None:
    assert_same(hard, change_of(hard, np.random.default_rng(seed)))


@given(hard=hard_sets(st.just(2)))
@settings(max_examples=12, deadline=None)
def test_two_classes_swap_and_nothing_else_changes_in_any_bit(hard: HardSet) -> None:
    assert_same(hard, changes.classes_permuted(hard, np.random.default_rng(0)))


NEAR: dict[str, Change_] = {
    "classes permuted": changes.classes_permuted,
    "the set twice": lambda hard, _: changes.rows_several_times(hard, 2),
    "the set three times": lambda hard, _: changes.rows_several_times(hard, 3),
    "columns reversed": lambda hard, _: changes.columns_reversed(hard),
}


@pytest.mark.parametrize("change_of", NEAR.values(), ids=NEAR.keys())
@given(hard=hard_sets(st.integers(2, 4)), seed=st.integers(0, 2**32))
@settings(max_examples=8, deadline=None)
def test_scores_move_by_rounding_until_stumps_tie(change_of: Change_, hard: HardSet, seed: int) -> None:
    partings = Partings()
    partings.see(Followed(hard, rounds=8), change_of(hard, np.random.default_rng(seed)))
    assert not [found for found in partings.findings() if found.tried and not found.holds]


def test_stumps_that_part_without_a_tie_are_found() -> None:
    hard = intervals(4)
    other = HardSet("other", hard.X, np.roll(hard.labels, 1), 4, 0)
    partings = Partings()
    partings.see(Followed(hard, rounds=2), Change("no change at all", other, (0,), (0, 1, 2, 3)))
    *_, parted = partings.findings()
    assert parted.tried
    assert not parted.holds


@pytest.mark.parametrize("times", [2, 3, 5, 7])
def test_a_branch_counts_as_empty_by_its_share_however_often_the_set_is_there(times: int) -> None:
    # The lighter row has 3e-12 of the weight: between 2^12 of 2^51 and 2^12 of 2^50 units.
    hard = HardSet("light", np.array([[0], [1]]), np.array([0, 1]), 2, 1, np.array([1.0, 3e-12]))
    once, _ = boost(hard.X, hard.labels, 2, rounds=1, weights=hard.weights)
    again = changes.rows_several_times(hard, times).hard
    often, _ = boost(again.X, again.labels, 2, rounds=1, weights=again.weights)
    np.testing.assert_allclose(often.values, once.values, rtol=1e-15)


def shape(tree: Tree) -> list[tuple[int | None, tuple[int, ...]]]:
    return [(node.input, node.values) for node in tree.nodes]


@given(hard=hard_sets(st.integers(2, 5)), seed=st.integers(0, 2**32), times=st.integers(2, 4))
@settings(max_examples=25, deadline=None)
def test_id3_asks_the_same_of_renumbered_classes_and_of_a_set_several_times_over(
    hard: HardSet, seed: int, times: int
) -> None:
    tree = shape(grow_id3(hard.X, hard.labels))
    for change in (
        changes.classes_permuted(hard, np.random.default_rng(seed)),
        changes.rows_several_times(hard, times),
    ):
        assert shape(grow_id3(change.hard.X, change.hard.labels)) == tree
    pruned = grow_id3(hard.X, hard.labels, min_samples=4)
    often = changes.rows_several_times(hard, times).hard
    assert shape(grow_id3(often.X, often.labels, min_samples=4 * times)) == shape(pruned)


@given(hard=hard_sets(st.integers(2, 5)))
@settings(max_examples=25, deadline=None)
def test_id3_answers_the_most_frequent_class_of_a_frame_in_whatever_order_its_columns_are(hard: HardSet) -> None:
    counts = counted(hard)
    for X in (hard.X, changes.columns_reversed(hard).hard.X):
        answers = grow_id3(X, hard.labels).predict(X).tolist()
        for frame, answer in zip(hard.X.tolist(), answers, strict=True):
            own = counts[tuple(frame)]
            assert answer == own.index(max(own))


@given(hard=hard_sets(st.integers(2, 4)))
@settings(max_examples=15, deadline=None)
def test_names_of_classes_are_only_names(hard: HardSet) -> None:
    names = np.array(["ab", "cd", "ef", "gh"])
    plain = LogitBoostClassifier(rounds=10).fit(hard.X, hard.labels)
    named = LogitBoostClassifier(rounds=10).fit(hard.X, names[hard.labels])
    np.testing.assert_array_equal(plain.decision_function(hard.X), named.decision_function(hard.X))
    np.testing.assert_array_equal(names[plain.predict(hard.X)], named.predict(hard.X))


def test_an_ensemble_of_a_changed_set_is_read_in_the_old_numbers() -> None:
    rng = np.random.default_rng(1)
    X = rng.permutation(60).reshape(20, 3)
    hard = HardSet("no ties", X, rng.integers(0, 2, 20), 2, 0)
    change = changes.columns_reversed(hard)
    one, _ = boost(hard.X, hard.labels, 2, rounds=5)
    other, _ = boost(change.hard.X, change.hard.labels, 2, rounds=5)
    assert not np.array_equal(one.columns, other.columns)
    np.testing.assert_array_equal(one.columns, renumbered(other, change).columns)
    np.testing.assert_array_equal(one.scores(hard.X), renumbered(other, change).scores(hard.X))
