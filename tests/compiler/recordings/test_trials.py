import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from thenar.compiler.arrays import groups, otsu
from thenar.compiler.recordings.readings import fill, numbered, restarts

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
