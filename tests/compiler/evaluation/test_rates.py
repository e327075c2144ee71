from collections import Counter
from pathlib import Path
from random import Random

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from mpmath import mpf
from scipy.special import stdtrit
from scipy.stats import binomtest, t

from thenar.compiler.evaluation.rates import Paired, Rate, rated
from thenar.stability.reference.intervals import student_quantile
from thenar.stability.reference.numbers import ulps

totals = st.integers(1, 2000)


def counted(correct: tuple[int, ...], total: int, repeats_a_draw: int = 1) -> Rate:
    return Rate.counted(correct, total, of="pooled", repeats_a_draw=repeats_a_draw)


@st.composite
def repeated(draw: st.DrawFn) -> tuple[tuple[int, ...], int]:
    total = draw(totals)
    return tuple(draw(st.lists(st.integers(0, total), min_size=1, max_size=6))), total


@given(st.data())
def test_one_repeat_has_wilsons_interval_as_scipy_computes_it(data: st.DataObject) -> None:
    total = data.draw(totals)
    correct = data.draw(st.integers(0, total))
    rate = counted((correct,), total)
    expected = binomtest(correct, total).proportion_ci(0.95, method="wilson")
    assert (rate.low, rate.high) == pytest.approx((expected.low, expected.high), abs=1e-12)


@given(repeated())
@example(((0, 0, 0), 5))
@example(((5, 5, 5), 5))
@example(((1, 0), 1))
def test_the_interval_holds_the_mean_and_stays_within_0_and_1(case: tuple[tuple[int, ...], int]) -> None:
    rate = counted(*case)
    assert 0 <= rate.low <= rate.mean <= rate.high <= 1
    assert rate.mean == pytest.approx(sum(case[0]) / len(case[0]) / case[1])


@given(repeated())
def test_it_is_never_narrower_than_students_t_over_the_repeats(case: tuple[tuple[int, ...], int]) -> None:
    correct, total = case
    assume(len(set(correct)) > 1)
    rates = [count / total for count in correct]
    spread = sum((r - sum(rates) / len(rates)) ** 2 for r in rates) / (len(rates) - 1)
    expected = t.interval(0.95, len(rates) - 1, sum(rates) / len(rates), (spread / len(rates)) ** 0.5)
    rate = counted(correct, total)
    assert rate.low <= max(0, expected[0]) + 1e-12
    assert rate.high >= min(1, expected[1]) - 1e-12


def test_repeats_of_one_draw_are_no_more_certain_than_its_mean() -> None:
    several = counted((800, 802, 900, 902, 851, 849), 1000, repeats_a_draw=2)
    alone = counted((801, 901, 850), 1000)
    assert (several.mean, several.low, several.high) == pytest.approx((alone.mean, alone.low, alone.high))
    assert several.low < counted(several.correct, 1000).low


@pytest.mark.parametrize(("correct", "total"), [((), 5), ((6,), 5), ((-1,), 5), ((0,), 0)])
def test_what_is_no_rate_is_refused(correct: tuple[int, ...], total: int) -> None:
    with pytest.raises(ValueError, match="do not give a rate"):
        counted(correct, total)
    with pytest.raises(ValueError, match="do not give a rate"):
        Rate.predicted([], [], [], of="pooled")
    with pytest.raises(ValueError, match="do not give a rate"):
        Rate.predicted([1, 2], [1, 2], [0], of="pooled")


@st.composite
def predicted_rows(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Up to three repeats of predictions (r, n), labels (n,) and trials (n,), a trial's rows anywhere in the set."""
    trials = np.array(draw(st.lists(st.integers(0, 9), min_size=1, max_size=40)))
    label = np.array(draw(st.lists(st.sampled_from([3, 5, 8]), min_size=10, max_size=10)))
    repeats = draw(st.integers(1, 3))
    given = draw(st.lists(st.sampled_from([3, 5, 8]), min_size=repeats * len(trials), max_size=repeats * len(trials)))
    return np.reshape(given, (repeats, -1)), label[trials], trials


@given(predicted_rows())
def test_a_trial_is_the_majority_of_frames_ties_lowest_label(
    case: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> None:
    predicted, labels, trials = case
    correct = []
    for one in predicted:
        hits = 0
        for trial in np.unique(trials):
            votes = Counter(one[trials == trial].tolist())
            most = min(label for label, count in votes.items() if count == max(votes.values()))
            hits += most == labels[trials == trial][0]
        correct.append(hits)
    by_trial, by_frame = rated(predicted, labels, trials, of="within subject")
    assert (by_trial.correct, by_trial.total) == (tuple(correct), len(np.unique(trials)))
    assert by_trial.over == by_trial.total
    if by_frame is None:
        assert by_trial.total == len(trials)
    else:
        assert (by_frame.correct, by_frame.total) == (tuple((predicted == labels).sum(axis=1)), len(trials))
        assert by_frame.over == by_trial.total
        assert by_frame.mean == pytest.approx((predicted == labels).mean())
        assert 0 <= by_frame.low <= by_frame.mean <= by_frame.high <= 1


@given(predicted_rows(), st.randoms(use_true_random=False))
def test_the_order_of_rows_and_the_names_of_trials_say_nothing(
    case: tuple[np.ndarray, np.ndarray, np.ndarray], random: Random
) -> None:
    predicted, labels, trials = case
    order = list(range(len(trials)))
    random.shuffle(order)
    assert rated(predicted, labels, trials, of="pooled") == rated(
        predicted[:, order], labels[order], 7 - trials[order], of="pooled"
    )


def test_new_subject_rates_are_over_subjects_single_ones_over_trials() -> None:
    # Seven people, 172 trials each, of whom 31 to 98 % are recognised: no sample of people says much of the next.
    shares = [0.31, 0.98, 0.72, 0.55, 0.90, 0.84, 0.76]
    hits = np.concatenate([np.arange(172) < round(172 * share) for share in shares])
    subjects = np.repeat(list("ABCDEFG"), 172)
    rate = Rate.predicted(hits, np.ones(len(hits)), np.arange(len(hits)), of="new subject", groups=subjects)
    assert (rate.over, rate.total, rate.what) == (7, 7 * 172, "new subject, trials")
    students = t.interval(0.95, 6, np.mean(shares), np.std(shares, ddof=1) / 7**0.5)
    assert rate.high - rate.low == pytest.approx(students[1] - students[0], rel=0.15)
    assert (rate.high - rate.low) / 2 > 0.15
    one = Rate.predicted(hits[:172], np.ones(172), np.arange(172), of="new subject", groups=subjects[:172])
    assert one.over == 172
    assert (one.high - one.low) / 2 < 0.08


def test_a_rate_says_in_words_what_it_is_of() -> None:
    assert str(Rate.counted((731,), 1000, of="new object")) == "73.1 [70.3, 75.8] % new object, trials"


def test_the_quantile_of_students_t_is_scipys_within_a_few_ulp() -> None:
    # 21 at 6 degrees of freedom, which a percentage never shows; the case of the statistics relies on 4 up to 3.
    for freedom in range(1, 51):
        off = ulps(float(stdtrit(freedom, 0.975)), student_quantile(freedom, mpf(0.975)))
        assert off <= (4 if freedom <= 3 else 32), freedom


@given(st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=200))
def test_two_recognisers_are_paired_by_mcnemars_exact_test(trials: list[tuple[bool, bool]]) -> None:
    own, other = np.array(trials).T
    paired = Paired.of(own[np.newaxis], other[np.newaxis], "another")
    assert (paired.better, paired.worse) == (int((own & ~other).sum()), int((other & ~own).sum()))
    differ = paired.better + paired.worse
    assert paired.p == pytest.approx(binomtest(paired.better, differ).pvalue if differ else 1)
    assert paired.difference == pytest.approx(own.mean() - other.mean())
    again = Paired.of(np.tile(own, (3, 1)), np.tile(other, (3, 1)), "another")
    assert again == paired


def test_of_several_repeats_a_trial_counts_once() -> None:
    own, other = np.array([[1, 1, 0], [1, 0, 0], [1, 1, 1]], bool), np.array([[1, 0, 0], [0, 1, 0], [1, 1, 0]], bool)
    paired = Paired.of(own, other, "another")
    assert (paired.better, paired.worse, paired.difference) == (2, 0, 2 / 9)
    assert str(paired) == "+22.2, p 0.5"


def test_the_protocol_of_a_recording_day_shows_the_intervals_of_today() -> None:
    """Of people, half with 85 % and half with 95 % of 80 trials (of an odd number, one with 90 %); of pooled trials."""
    page = (Path(__file__).parents[3] / "docs" / "how-to" / "record.md").read_text(encoding="utf-8")
    rows = {cells[1].strip(): cells[2:-1] for line in page.splitlines() if len(cells := line.split("|")) > 5}
    lows, highs = list(map(float, rows["new subject, from"])), [line for line in page.splitlines() if "| to |" in line]
    ends = [list(map(float, line.split("|")[2:-1])) for line in highs]
    for people, low, high in zip(map(int, rows["people"]), lows, ends[0], strict=True):
        right = [(68, 76)[number % 2] for number in range(people - people % 2)] + [72] * (people % 2)
        hits = np.concatenate([np.arange(80) < count for count in right]).astype(int)
        who = np.repeat(np.arange(people), 80)
        rate = Rate.predicted(hits, np.ones_like(hits), np.arange(len(hits)), of="new subject", groups=who)
        assert (round(100 * rate.low, 1), round(100 * rate.high, 1)) == (low, high)
    for trials, low, high in zip(
        map(int, rows["trials in all"]), map(float, rows["pooled, from"]), ends[1], strict=True
    ):
        rate = counted((round(0.9 * trials),), trials)
        assert (round(100 * rate.low, 1), round(100 * rate.high, 1)) == (low, high)
