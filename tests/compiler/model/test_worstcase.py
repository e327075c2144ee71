from fractions import Fraction
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thenar.compiler.model.collapse import collapse
from thenar.compiler.model.compare import float_slack
from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.model.proof import Rounding, _Pairs
from thenar.runtime.model.quantise import quantise, rounding_error
from thenar.runtime.model.tables import ScoreTables

from ...conftest import peak_bytes
from .conftest import make_rows, make_stumps

widths = st.sampled_from([4, 5, 6, 8, 16])


@given(seed=st.integers(0, 10_000), width=widths)
def test_the_worst_is_within_what_counting_inputs_promises(seed: int, width: int) -> None:
    tables = collapse(make_stumps(seed), 6)
    integers = quantise(tables, *make_rows(seed), width)
    rounding = Rounding(tables, integers)
    loss = rounding.worst_of_all().loss
    assert 0 <= loss <= 2 * (rounding_error(tables, integers.scale) + float_slack(tables, integers.scale))
    assert loss - 1 <= rounding.safe_margin() <= loss


def _switches(bias: list[float], rows: list[list[float]], steps: list[int], whole: list[list[int]]) -> Rounding:
    none = np.zeros((0, len(bias)), np.int16)
    switch_rows = np.array(whole, np.int16).reshape(-1, len(bias))
    tables = ScoreTables.of(np.array(bias), np.array(rows).reshape(-1, len(bias)), (), ())
    return Rounding(
        tables, IntegerTables.of(np.array(steps, np.int16), switch_rows, (), (), 0 * switch_rows, none, scale=2.0)
    )


@pytest.mark.parametrize(("leader", "safe"), [(0, "0"), (1, "3/4")])
def test_ties_go_to_the_lower_number_others_need_a_step(leader: int, safe: str) -> None:
    bias = [0.0, 0.0]
    bias[leader] = 0.375  # at 2 steps a unit, 3/4 of a step, of which nothing is left
    rounding = _switches(bias, [], [0, 0], [])
    assert rounding.worst(leader, 1 - leader).loss == Fraction(3, 4)
    assert rounding.worst(1 - leader, leader).loss == -Fraction(3, 4)
    assert rounding.safe_margin() == Fraction(safe)


def test_bins_that_rounding_has_merged_are_still_told_apart() -> None:
    rows = np.array([[0.0, 0.0], [0.25, 0.0], [3.0, 0.0]])
    tables = ScoreTables.of(np.zeros(2), np.zeros((0, 2)), (np.array([10, 20], np.uint16),), (rows,))
    none = np.zeros((0, 2), np.int16)
    whole = np.array([[0, 0], [3, 0]], np.int16)
    integers = IntegerTables.of(none.sum(axis=0, dtype=np.int16), none, (np.array([20], np.uint16),), (whole,), none,
                             np.zeros((1, 2), np.int16), 1.0)  # fmt: skip
    worst = Rounding(tables, integers).worst(0, 1)
    assert (worst.codes.tolist(), worst.loss) == ([11], Fraction(1, 4))


def test_a_bin_that_no_code_falls_into_is_no_frame() -> None:
    rows = np.array([[0.0, 0.0], [0.25, 0.0]])
    tables = ScoreTables.of(np.zeros(2), np.zeros((0, 2)), (np.array([65535], np.uint16),), (rows,))
    none = np.zeros((0, 2), np.int16)
    means = np.zeros((1, 2), np.int16)
    integers = IntegerTables.of(np.zeros(2, np.int16), none, (np.array([], np.uint16),), (means,), none, means, 1.0)
    assert Rounding(tables, integers).worst_of_all().loss == 0


def test_scores_down_to_the_smallest_doubles_are_compared_exactly() -> None:
    tiny = 5e-324
    rounding = _switches([0.0, 0.0], [[tiny, 0.0]], [0, 0], [[0, 0]])
    assert rounding.worst(0, 1).loss == Fraction(tiny) * 2
    assert rounding.worst(1, 0).loss == 0
    assert rounding.safe_margin() == 0


@pytest.mark.parametrize(("bin_", "code"), [(0, 0), (1, 1), (2, 65535)])
def test_the_first_and_last_code_may_have_single_bins(bin_: int, code: int) -> None:
    rows = np.zeros((3, 2))
    rows[bin_, 0] = 0.25
    steps, none = (np.array([0, 65534], np.uint16),), np.zeros((0, 2), np.int16)
    whole = (np.zeros((3, 2), np.int16),)
    integers = IntegerTables.of(np.zeros(2, np.int16), none, steps, whole, none, np.zeros((1, 2), np.int16), 1.0)
    worst = Rounding(ScoreTables.of(np.zeros(2), np.zeros((0, 2)), steps, (rows,)), integers).worst(0, 1)
    assert (worst.codes.tolist(), worst.loss) == ([code], Fraction(1, 4))


_long = st.integers(-(2**200), 2**200)
# Of few numbers, so that pairs tie, also in all but their last bits.
_alike = st.sampled_from([0, 1, -1, 2**150, 2**150 + 1, 2**150 - 1, -(2**150), 2**61, 2**61 - 1])


@settings(max_examples=150)
@given(data=st.data(), classes=st.integers(2, 6), numbers=st.sampled_from([_long, _alike, st.integers(-9, 9)]))
def test_the_worst_pair_is_found_exactly_and_first_on_ties(
    data: st.DataObject, classes: int, numbers: st.SearchStrategy[int]
) -> None:
    choices = data.draw(st.lists(st.integers(1, 3), min_size=1, max_size=4))
    rows = [[[data.draw(numbers) for _ in range(classes)] for _ in range(count)] for count in choices]
    tie = data.draw(st.sampled_from([0, 1, 2**61, 2**150, 2**1100]))
    losses = {
        (leader, competitor): sum(max(row[leader] - row[competitor] for row in each) for each in rows)
        - tie * (leader < competitor)
        for leader, competitor in permutations(range(classes), 2)
    }
    worst = max(losses, key=losses.__getitem__)
    assert _Pairs([np.array(each, object) for each in rows]).greatest(tie) == (losses[worst], *worst)


def test_a_thousand_classes_take_no_more_memory_than_their_pairs_need() -> None:
    random = np.random.default_rng(0)
    tables = ScoreTables.of(np.zeros(1000), random.normal(0, 1, (20, 1000)), (), ())
    integers = quantise(tables, random.random((50, 20)) < 0.5, np.zeros((50, 0), np.uint16))
    losses = list[Fraction]()
    assert peak_bytes(lambda: losses.append(Rounding(tables, integers).worst_of_all().loss)) < 100 * 1000**2
    assert losses[0] > 5
