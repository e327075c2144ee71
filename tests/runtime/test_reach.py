from collections.abc import Callable
from itertools import product

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from thenar.runtime.scores import Scorer
from thenar.runtime.tables import IntegerTables

MakeTables = Callable[..., IntegerTables]


@given(seed=st.integers(0, 100), leader=st.integers(0, 4), unread=st.integers(0, 31))
def test_it_is_the_most_that_any_state_of_the_unread_switches_brings(
    make_tables: MakeTables, seed: int, leader: int, unread: int
) -> None:
    tables = make_tables(seed, switches=5)
    each = [
        (np.zeros(5, int), tables.switch_rows[switch].astype(int), tables.switch_means[switch].astype(int))
        for switch in range(5)
        if unread >> switch & 1
    ]
    sums = np.array([np.sum(states, axis=0) + np.zeros(5, int) for states in product(*each)])
    assert Scorer(tables).reach(leader, unread) == tuple((sums - sums[:, [leader]]).max(axis=0))


def test_a_leader_does_not_overtake_itself_and_nothing_unread_changes_nothing(make_tables: MakeTables) -> None:
    scorer = Scorer(make_tables())
    assert [scorer.reach(leader, 511)[leader] for leader in range(5)] == [0] * 5
    assert scorer.reach(2, 0) == (0,) * 5


def test_the_most_there_is_does_not_wrap_round() -> None:
    rows, none = np.array([[32767, -32767]], np.int16), np.zeros((0, 2), np.int16)
    tables = IntegerTables(np.zeros(2, np.int16), rows, (), (), rows, none, 1.0)
    assert Scorer(tables).reach(1, 1) == (65534, 0)
