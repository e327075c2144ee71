import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from thenar.compiler.arrays import groups, otsu
from thenar.compiler.recordings import TableError
from thenar.compiler.recordings.cells import Column
from thenar.compiler.recordings.columns import ColumnRoles, JointColumns, select
from thenar.compiler.recordings.readings import fill, numbered, read_cells, restarts
from thenar.compiler.recordings.table import Table

GOOD = {
    "g": ["a", "b", "c"],
    "who": ["x", "y", "y"],
    "n": ["1", "2", "3"],
    "s": ["0", "1", "true"],
    "j": ["1.5", "2", "3"],
}


def read(columns: ColumnRoles, **cells: Column) -> None:
    table = Table("t.csv", GOOD | cells, np.array([2, 3, 5]))
    read_cells(table, columns, select(columns, list(table.columns)))


ALL = ColumnRoles("g", subject="who", trial="n", switches=("s",), joints=(JointColumns(("j",)),))
DROP = ColumnRoles("g", subject="who", trial="n", switches=("s",), joints=(JointColumns(("j",)),), missing="drop")


def test_wrong_cells_are_counted_and_named_by_the_users_rows() -> None:
    with pytest.raises(TableError) as refused:
        read(ALL, s=["0", "2", "no"], j=["x", "1", "inf"], n=["1", "1.5", "2"], g=["a", "b\x07", "c"])
    assert str(refused.value) == (
        "t.csv: not names that can be printed: 1 cell, row 3 'g' ('b\\x07'); "
        "not 0 or 1: 2 cells, row 3 's' ('2'), row 5 's' ('no'); "
        "not finite numbers: 2 cells, row 2 'j' ('x'), row 5 'j' ('inf')"
    )


def test_missing_cells_are_an_error_unless_their_rows_may_be_dropped() -> None:
    with pytest.raises(TableError, match=r"missing .*: 2 cells, row 2 'j' \(''\), row 5 'who' \('\?'\)"):
        read(ALL, j=["", "2", "3"], who=["x", "y", "?"])


def test_a_wrong_cell_is_an_error_even_in_dropped_rows() -> None:
    with pytest.raises(TableError, match="not 0 or 1"):
        read(DROP, s=["2", "1", "1"], j=["", "2", "3"])


def test_a_table_of_which_nothing_is_left_is_refused() -> None:
    with pytest.raises(TableError, match=r"t\.csv: every row misses a value: 3 cells"):
        read(DROP, g=["", "?", " "])


def test_the_first_wrong_cells_are_named_and_the_rest_counted() -> None:
    columns = [f"s{number}" for number in range(10)]
    table = Table("t.csv", {"g": ["a"] * 9} | {name: ["7"] * 9 for name in columns}, np.arange(1, 10))
    wanted = ColumnRoles("g", switches=("s*",))
    with pytest.raises(TableError) as refused:
        read_cells(table, wanted, select(wanted, list(table.columns)))
    shown = ", ".join(f"row 1 's{number}' ('7')" for number in range(5))
    assert str(refused.value) == f"t.csv: not 0 or 1: 90 cells, {shown} and 85 more"


IDS = hnp.arrays(np.intp, st.integers(1, 30), elements=st.integers(0, 4))


@given(IDS, st.data())
def test_rows_get_one_number_exactly_where_all_columns_are_equal(first: np.ndarray, data: st.DataObject) -> None:
    second = data.draw(hnp.arrays(np.intp, len(first), elements=st.integers(0, 3)))
    pairs = list(zip(first.tolist(), second.tolist(), strict=True))
    seen = list(dict.fromkeys(pairs))
    assert groups(first, second).tolist() == [seen.index(pair) for pair in pairs]
    numbers, texts = numbered([first.astype(str), second.astype(str)])
    order = sorted(set(pairs))
    assert texts == [f"{a} {b}" for a, b in order]
    assert numbers.tolist() == [order.index(pair) + 1 for pair in pairs]


@given(st.lists(st.integers(10, 40), min_size=4, max_size=8), st.integers(0, 2**32 - 1))
def test_a_clock_that_repeats_or_jitters_starts_no_trial(sizes: list[int], seed: int) -> None:
    random = np.random.default_rng(seed)
    time = np.concatenate([10.0 * np.arange(size) for size in sizes])
    expected = np.repeat(np.arange(len(sizes)) + 1, sizes)
    jittered = time + random.integers(-9, 10, len(time)).astype(np.float64)
    repeated = np.where((random.random(len(time)) < 0.3) & (time > 10), np.roll(time, 1), time)
    for clock in (time, jittered, repeated):
        assert restarts(np.zeros(len(time), np.intp), clock.astype(np.float64)).tolist() == expected.tolist()


@given(IDS, st.data())
def test_gaps_are_filled_from_the_trial_else_with_the_median(ids: np.ndarray, data: st.DataObject) -> None:
    values = data.draw(hnp.arrays(np.int64, len(ids), elements=st.integers(0, 9)))
    missing = data.draw(hnp.arrays(np.bool_, len(ids)).filter(lambda mask: not mask.all()))
    expected, strange = values.copy(), 0
    present = sorted(values[~missing].tolist())
    for row in np.flatnonzero(missing).tolist():
        frames = np.flatnonzero(ids == ids[row]).tolist()
        there = [frame for frame in frames if not missing[frame]]
        near = min(there, key=lambda frame: (abs(frames.index(frame) - frames.index(row)), frame), default=None)
        strange += near is None
        expected[row] = present[(len(present) - 1) // 2] if near is None else values[near]
    assert fill(values, missing, ids) == strange
    assert values.tolist() == expected.tolist()


@given(hnp.arrays(np.float64, st.integers(2, 40), elements=st.integers(-50, 50)))
def test_otsus_threshold_leaves_the_least_variance_within(values: np.ndarray) -> None:
    threshold = otsu(values)

    def within(border: float) -> float:
        parts = values[values <= border], values[values > border]
        return sum(float(((part - part.mean()) ** 2).sum()) for part in parts if part.size)

    found = np.unique(values)
    least = min(map(within, found[:-1]), default=0.0)
    assert within(threshold) == pytest.approx(least, abs=1e-9)
    assert len(found) == 1 or threshold not in found


def test_otsus_threshold_is_finite_at_the_ends_of_the_doubles() -> None:
    assert otsu(np.array([-1.7e308, -1.6e308, 1.7e308])) == pytest.approx(5e306)
    assert (otsu(np.array([np.nan])), otsu(np.array([3.0, np.nan]))) == (0.0, 3.0)
