"""The bounded search beside all subsets there are."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thenar.compiler.placement.inputs import PlacementError
from thenar.compiler.placement.optimum import Pairs, best_subset, filled, swapped
from thenar.compiler.samples import Columns, Samples


@st.composite
def small(draw: st.DrawFn) -> Samples:
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n, s, types = draw(st.integers(1, 30)), draw(st.integers(1, 8)), draw(st.integers(1, 4))
    bits = random.random((n, s)) < random.choice([0.1, 0.3, 0.5])
    return Samples(bits, np.zeros((n, 0), np.uint16), random.integers(0, types, n), tuple(map(str, range(types))))


def alike_by_definition(learning: Samples, columns: Columns) -> int:
    rows = [tuple(row) for row in learning.switches[:, list(columns)].tolist()]
    return sum(
        rows[a] == rows[b] and learning.labels[a] != learning.labels[b] for a, b in combinations(range(len(rows)), 2)
    )


@given(small(), st.data())
def test_pairs_are_counted_as_defined(learning: Samples, data: st.DataObject) -> None:
    columns = tuple(data.draw(st.lists(st.integers(0, learning.n_switches - 1), unique=True)))
    pairs = Pairs(learning)
    assert pairs.alike(columns) == alike_by_definition(learning, columns)
    further = [alike_by_definition(learning, (*columns, a)) for a in range(learning.n_switches)]
    assert pairs.gains(columns).tolist() == [pairs.alike(columns) - alike for alike in further]


@settings(max_examples=60)
@given(small(), st.integers(0, 9))
def test_no_subset_is_better_than_the_bound_and_the_proved_one_is_best(learning: Samples, m: int) -> None:
    found = best_subset(learning, m, rounds=60)
    varying = Pairs(learning).varying.tolist()
    size = min(m, len(varying))
    best = min(alike_by_definition(learning, columns) for columns in combinations(varying, size))
    assert found.alike == alike_by_definition(learning, found.columns) >= best >= found.least
    assert len(found.columns) == size
    assert found.proved
    assert found.alike == best
    assert found.proved


@settings(max_examples=40)
@given(small(), st.integers(0, 6))
def test_a_search_that_is_cut_short_still_bounds_all_subsets(learning: Samples, m: int) -> None:
    for rounds in (0, 1, 2):
        found = best_subset(learning, m, rounds=rounds)
        size = len(found.columns)
        best = min(
            alike_by_definition(learning, columns) for columns in combinations(Pairs(learning).varying.tolist(), size)
        )
        assert found.least <= best <= found.alike
        assert found.nodes <= rounds
        assert 0 <= found.least <= found.alike <= found.pairs


def three_of_twelve() -> Samples:
    """A greedy search takes switch 0 first, which the best three do without."""
    random = np.random.default_rng(5)
    labels = np.arange(320) % 8
    bits = random.random((320, 12)) < 0.5
    for place, column in enumerate((3, 6, 9)):
        bits[:, column] = (labels >> place) & 1
    bits[:, 0] = (labels >= 4) ^ (labels == 7)
    return Samples(bits, np.zeros((320, 0), np.uint16), labels, tuple("01234567"))


def test_the_switches_that_tell_everything_apart_are_found_and_proved() -> None:
    found = best_subset(three_of_twelve(), 3)
    assert (sorted(found.columns), found.alike, found.least, found.proved) == ([3, 6, 9], 0, 0, True)


def test_progress_is_told_and_a_start_is_never_made_worse() -> None:
    random = np.random.default_rng(2)
    labels = np.arange(200) % 5
    bits = (random.random((5, 14)) < 0.4)[labels] ^ (random.random((200, 14)) < 0.2)
    learning = Samples(bits, np.zeros((200, 0), np.uint16), labels, tuple("01234"))
    told: list[tuple[int, int]] = []
    start = (13, 12, 11, 10)
    found = best_subset(learning, 4, rounds=3, starts=(start,), on_round=lambda done, all_: told.append((done, all_)))
    assert told == [(done, 3) for done in range(1, found.nodes + 1)]
    assert found.alike <= Pairs(learning).alike(start)


@given(small(), st.integers(1, 5))
def test_exchanging_ends_where_no_exchange_helps(learning: Samples, m: int) -> None:
    pairs = Pairs(learning)
    columns = swapped(pairs, filled(pairs, (), min(m, len(pairs.varying))))
    for gone in columns:
        rest = tuple(column for column in columns if column != gone)
        assert all(pairs.alike((*rest, other)) >= pairs.alike(columns) for other in pairs.varying.tolist())


def test_nonsense_is_refused() -> None:
    with pytest.raises(PlacementError, match="at least 0"):
        best_subset(three_of_twelve(), -1)


def test_the_solver_writes_nothing_onto_stdout(capfd: pytest.CaptureFixture[str]) -> None:
    best_subset(three_of_twelve(), 4)
    assert capfd.readouterr().out == ""
