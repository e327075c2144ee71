"""Rates and quantiles; whether intervals cover the truth; the luck of the best of many, by counting all draws."""

import runpy
from collections import Counter
from itertools import product
from pathlib import Path
from random import Random

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from mpmath import mpf
from numpy.typing import NDArray
from scipy.special import stdtrit
from scipy.stats import binomtest, t

from thenar.compiler.evaluation.folds import trial_folds, weka_folds
from thenar.compiler.evaluation.rates import Draws, Paired, Rate, rated
from thenar.stability.reference.intervals import student_quantile
from thenar.stability.reference.numbers import ulps

totals = st.integers(1, 2000)


def counted(correct: tuple[int, ...], total: int, repeats_a_draw: int = 1) -> Rate:
    return Rate.counted(correct, total, of="pooled", repeats_a_draw=repeats_a_draw)


@st.composite
def repeated(draw: st.DrawFn) -> tuple[tuple[int, ...], int]:
    total = draw(totals)
    return tuple(draw(st.lists(st.integers(0, total), min_size=1, max_size=6))), total


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


SIMULATED = runpy.run_path(str(Path(__file__).resolve().parents[3] / "benchmarks" / "intervals.py"))
coverage, of_frames, of_subjects, ACCURACIES = (
    SIMULATED[name] for name in ("coverage", "of_frames", "of_subjects", "ACCURACIES")
)


@pytest.mark.parametrize(
    ("unit", "clusters", "size", "alike"),
    [
        ("trials", 60, 1, 0.0),
        ("frames", 60, 8, 4 / 7),
        ("frames", 200, 15, 4 / 14),
        ("trials", 12, 100, 0.1),
        ("trials", 20, 100, 0.05),
    ],
)
def test_intervals_cover_the_truth_in_93_to_97_of_100_cases(unit: str, clusters: int, size: int, alike: float) -> None:
    covered = np.mean([coverage(unit, clusters, size, alike, each, 500) for each in ACCURACIES])
    assert 0.93 <= covered <= 0.97


@pytest.mark.slow
def test_intervals_cover_the_truth_for_any_frames_and_trials() -> None:
    for frames, effect, trials, covered in of_frames(200):
        # Of frames as different as trials, which real ones are not, the interval may be a little wide.
        most = 0.97 if effect > 1.5 or frames == 1 else 0.985
        assert 0.93 <= np.mean(covered) <= most, (frames, effect, trials)
        assert min(covered) >= 0.885, (frames, effect, trials)


@pytest.mark.slow
def test_so_they_do_for_5_to_30_subjects_left_out() -> None:
    for subjects, alike, covered in of_subjects(300):
        # Of few people, or where they hardly differ, the interval may be a little wide.
        most = 0.97 if subjects > 12 and alike > 0.02 else 0.985
        assert 0.93 <= np.mean(covered) <= most, (subjects, alike)
        assert min(covered) >= 0.90, (subjects, alike)


TYPES, TRIALS, FRAMES = 4, 15, 8
NOISE = 0.55  # of frames, where trials differ by 1: a design effect of about 4


def recorded(random: np.random.Generator) -> tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.intp]]:
    """Return joints (n, 4), labels (n,) and trials (n,) of 15 trials a type, of 8 frames each."""
    labels = np.repeat(np.arange(TYPES), TRIALS)
    means = 1.3 * np.eye(TYPES)[labels] + random.normal(0, 1, (len(labels), TYPES))
    frames = np.repeat(means, FRAMES, axis=0) + random.normal(0, NOISE, (len(labels) * FRAMES, TYPES))
    return frames, np.repeat(labels, FRAMES), np.repeat(np.arange(len(labels)), FRAMES)


def nearest(train: NDArray[np.float64], labels: NDArray[np.intp], test: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the label of the nearest row."""
    squares = (train**2).sum(axis=1) - 2 * test @ train.T
    found: NDArray[np.intp] = labels[squares.argmin(axis=1)]
    return found


@pytest.fixture(scope="module")
def simulations() -> list[tuple[float, Rate, Rate, Rate]]:
    """Of each set: the accuracy on fresh trials; the rate of random rows; of whole trials, by trials and by frames."""
    found = []
    for seed in range(100):
        random = np.random.default_rng(seed)
        X, labels, trials = recorded(random)
        fresh, true, _ = recorded(random)
        predicted = {}
        for name, folds in (
            ("rows", weka_folds(labels, 4, 1)),
            ("trials", trial_folds(labels, trials, 4, 1)),
        ):
            predicted[name] = np.zeros_like(labels)
            for fold in folds:
                predicted[name][fold.test] = nearest(X[fold.train], labels[fold.train], X[fold.test])
        truth = float(np.mean(nearest(X, labels, fresh) == true))
        leaked = Rate.counted((int((predicted["rows"] == labels).sum()),), len(labels), of="pooled")
        by_trial, by_frame = rated(predicted["trials"], labels, trials, of="pooled")
        assert by_frame is not None
        found.append((truth, leaked, by_trial, by_frame))
    return found


def test_random_folds_of_frames_are_too_high_and_cover_nothing(
    simulations: list[tuple[float, Rate, Rate, Rate]],
) -> None:
    truth = np.mean([each[0] for each in simulations])
    leaked = np.mean([each[1].mean for each in simulations])
    assert leaked - truth > 0.08
    assert np.mean([rate.low <= truth <= rate.high for _, rate, _, _ in simulations]) < 0.01


def test_whole_trials_counted_in_frames_cover_half_and_over_trials_nearly_always(
    simulations: list[tuple[float, Rate, Rate, Rate]],
) -> None:
    truth = np.mean([each[0] for each in simulations])
    frames = [each[3] for each in simulations]
    assert np.mean([rate.mean for rate in frames]) == pytest.approx(truth, abs=0.02)
    naive = [Rate.counted(rate.correct, rate.total, of="pooled") for rate in frames]
    assert 0.3 < np.mean([rate.low <= truth <= rate.high for rate in naive]) < 0.75
    # Less than 95 %: that a nearest neighbour's training set is a sample as well, no interval of its rate can know.
    assert np.mean([rate.low <= truth <= rate.high for rate in frames]) > 0.84
    widths = [(rate.high - rate.low) / (one.high - one.low) for rate, one in zip(frames, naive, strict=True)]
    assert 1.7 < np.mean(widths) < 2.8


SOME_HITS = st.tuples(st.integers(1, 5), st.integers(5, 9)).flatmap(
    lambda shape: arrays(np.intp, shape, elements=st.integers(0, 3))
)


def luck_of(hits: np.ndarray, units: np.ndarray | None = None, seed: int = 1) -> float:
    draws = Draws.of(hits, np.arange(hits.shape[1]) if units is None else units, seed)
    return draws.luck(np.arange(len(hits), dtype=np.float64), [np.inf])[0]


@given(hits=SOME_HITS, units=st.lists(st.integers(0, 2), min_size=9, max_size=9))
def test_of_few_units_every_draw_counts_once(hits: np.ndarray, units: list[int]) -> None:
    owners = np.array([0, 1, *units])[: hits.shape[1]]
    people = sorted(set(owners.tolist()))
    best, gaps = int(hits.sum(axis=1).argmax()), []
    for drawn in product(people, repeat=len(people)):
        bag = np.concatenate([np.flatnonzero(owners == one) for one in drawn])
        rest = np.flatnonzero(~np.isin(owners, drawn))
        if len(rest):
            picked = int((hits[:, bag].sum(axis=1)).argmax())
            gaps.append(hits[best, rest].mean() - hits[picked, rest].mean())
    assert luck_of(hits, owners) == pytest.approx(max(np.mean(gaps), 0.0), abs=1e-12)


@given(hits=SOME_HITS)
def test_a_single_contender_has_no_luck_and_a_twin_changes_none(hits: np.ndarray) -> None:
    assert luck_of(hits[:1]) == 0.0
    assert luck_of(np.concatenate([hits, hits])) == luck_of(hits)


def test_each_limit_has_the_luck_of_what_costs_less() -> None:
    hits = np.random.default_rng(3).integers(0, 2, (6, 40))
    costs = np.array([5.0, 1.0, 4.0, 2.0, 6.0, 3.0])
    draws = Draws.of(hits, np.arange(40), 1)
    alone = [
        Draws.of(hits[costs < limit], np.arange(40), 1).luck(costs[costs < limit], [np.inf])[0] for limit in (3.5, 9)
    ]
    assert draws.luck(costs, [3.5, 9.0]) == pytest.approx(alone)


def test_the_best_of_many_equals_is_corrected_to_what_each_is_worth() -> None:
    """A hundred contenders that all recognise 80 % of independent trials: the best seems to recognise 87 %."""
    seemed, promised = [], []
    for seed in range(30):
        hits = (np.random.default_rng(seed).random((100, 200)) < 0.8).astype(np.intp)
        seemed.append(hits.mean(axis=1).max())
        promised.append(seemed[-1] - luck_of(hits, seed=seed))
    assert np.mean(seemed) > 0.86
    assert np.mean(promised) == pytest.approx(0.8, abs=0.01)
