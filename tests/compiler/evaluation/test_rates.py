import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from mpmath import mpf
from scipy.special import stdtrit
from scipy.stats import binomtest, t

from thenar.compiler.evaluation.rates import Average, RepeatedRate
from thenar.stability.reference.intervals import student_quantile
from thenar.stability.reference.numbers import ulps

totals = st.integers(1, 2000)


@st.composite
def repeated(draw: st.DrawFn) -> tuple[tuple[int, ...], int]:
    total = draw(totals)
    return tuple(draw(st.lists(st.integers(0, total), min_size=1, max_size=6))), total


@given(st.data())
def test_one_repeat_has_wilsons_interval_as_scipy_computes_it(data: st.DataObject) -> None:
    total = data.draw(totals)
    correct = data.draw(st.integers(0, total))
    rate = RepeatedRate.of((correct,), total)
    expected = binomtest(correct, total).proportion_ci(0.95, method="wilson")
    assert (rate.low, rate.high) == pytest.approx((expected.low, expected.high), abs=1e-12)


@given(repeated())
@example(((0, 0, 0), 5))
@example(((5, 5, 5), 5))
@example(((1, 0), 1))
def test_the_interval_holds_the_mean_and_stays_within_0_and_1(case: tuple[tuple[int, ...], int]) -> None:
    rate = RepeatedRate.of(*case)
    assert 0 <= rate.low <= rate.mean <= rate.high <= 1
    assert rate.mean == pytest.approx(sum(case[0]) / len(case[0]) / case[1])


@given(repeated())
def test_it_is_never_narrower_than_students_t_over_the_repeats(case: tuple[tuple[int, ...], int]) -> None:
    correct, total = case
    assume(len(set(correct)) > 1)
    rates = [count / total for count in correct]
    spread = sum((r - sum(rates) / len(rates)) ** 2 for r in rates) / (len(rates) - 1)
    expected = t.interval(0.95, len(rates) - 1, sum(rates) / len(rates), (spread / len(rates)) ** 0.5)
    rate = RepeatedRate.of(correct, total)
    assert rate.low <= max(0, expected[0]) + 1e-12
    assert rate.high >= min(1, expected[1]) - 1e-12


@given(totals, st.integers(2, 5))
def test_repeats_that_all_recognise_everything_still_leave_doubt(total: int, repeats: int) -> None:
    rate = RepeatedRate.of((total,) * repeats, total)
    assert rate.high == 1
    assert rate.low == pytest.approx(RepeatedRate.of((total,), total).low)
    assert rate.low < 1


def test_repeats_that_differ_widely_widen_the_interval() -> None:
    agreeing, differing = RepeatedRate.of((900, 900, 900), 1000), RepeatedRate.of((850, 900, 950), 1000)
    assert differing.mean == agreeing.mean
    assert differing.low < agreeing.low
    assert differing.high > agreeing.high
    students = t.interval(0.95, 2, 0.9, 0.05 / 3**0.5)
    assert (differing.low, differing.high) == pytest.approx((students[0], 1.0))
    assert RepeatedRate.of((450, 500, 550), 1000).high == pytest.approx(students[1] - 0.4)


def test_repeats_of_one_draw_are_no_more_certain_than_its_mean() -> None:
    repeated = RepeatedRate.of((800, 802, 900, 902, 851, 849), 1000, repeats_a_draw=2)
    alone = RepeatedRate.of((801, 901, 850), 1000)
    assert (repeated.mean, repeated.low, repeated.high) == pytest.approx((alone.mean, alone.low, alone.high))
    assert repeated.low < RepeatedRate.of(repeated.correct, 1000).low


@pytest.mark.parametrize(("correct", "total"), [((), 5), ((6,), 5), ((-1,), 5), ((0,), 0)])
def test_what_is_no_rate_is_refused(correct: tuple[int, ...], total: int) -> None:
    with pytest.raises(ValueError, match="no rate"):
        RepeatedRate.of(correct, total)


@given(repeated())
def test_the_average_of_one_rate_is_that_rate(case: tuple[tuple[int, ...], int]) -> None:
    rate = RepeatedRate.of(*case)
    average = Average.of((rate,))
    assert (average.mean, average.low, average.high) == pytest.approx((rate.mean, rate.low, rate.high))


@given(repeated(), st.integers(2, 9))
def test_the_average_of_k_equal_rates_is_root_k_times_surer(case: tuple[tuple[int, ...], int], k: int) -> None:
    rate = RepeatedRate.of(*case)
    average = Average.of((rate,) * k)
    assert average.mean == pytest.approx(rate.mean)
    assert average.mean - average.low == pytest.approx((rate.mean - rate.low) / k**0.5, abs=1e-9)
    assert average.high - average.mean == pytest.approx((rate.high - rate.mean) / k**0.5, abs=1e-9)


def test_every_rate_weighs_the_same_in_an_average_whatever_its_rows() -> None:
    assert Average.of((RepeatedRate.of((10,), 10), RepeatedRate.of((0,), 1000))).mean == 0.5


@given(st.lists(st.tuples(st.integers(0, 23), st.integers(0, 23)), min_size=1, max_size=8))
@example([(0, 14), (23, 23), (23, 23), (23, 23), (23, 23)])
def test_an_average_stays_within_0_to_1_and_around_its_mean(correct: list[tuple[int, int]]) -> None:
    average = Average.of(tuple(RepeatedRate.of(counts, 23) for counts in correct))
    assert 0 <= average.low <= average.mean <= average.high <= 1


@pytest.mark.parametrize("freedom", range(1, 51))
def test_the_quantile_of_students_t_is_scipys_within_a_few_ulp(freedom: int) -> None:
    # 21 at 6 degrees of freedom, which a percentage never shows; the case of the statistics relies on 4 up to 3.
    off = ulps(float(stdtrit(freedom, 0.975)), student_quantile(freedom, mpf(0.975)))
    assert off <= (4 if freedom <= 3 else 32)
