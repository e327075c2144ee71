"""The search among sensors: against all subsets, scikit-learn's loss, and what it promises."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.linear_model import LogisticRegression

from thenar.compiler.placement import sensors
from thenar.compiler.placement.logistic import MARK_BITS, lines
from thenar.compiler.placement.sensors import NEAR, RIDGE, SensorSearch
from thenar.compiler.samples import Samples

SEEDS = st.integers(0, 2**32 - 1)


def drawn(seed: int, n: int = 90, switches: int = 5, pads: int = 2, joints: int = 3, classes: int = 4) -> Samples:
    """Return rows of which each sensor tells a little about the class, some more than others."""
    random = np.random.default_rng(seed)
    labels = np.arange(n) % classes
    shift = random.normal(0, 1, (classes, switches + pads + joints)) * random.uniform(0, 2, switches + pads + joints)
    values = shift[labels] + random.normal(0, 1, (n, shift.shape[1]))
    codes = np.clip(128 + 30 * values, 0, 255).astype(np.uint16)
    cuts = switches, switches + pads
    return Samples(
        values[:, : cuts[0]] > 0,
        codes[:, cuts[1] :],
        labels,
        tuple("abcdefgh"[:classes]),
        taxels=codes[:, cuts[0] : cuts[1]],
    )


def inputs_of(samples: Samples) -> np.ndarray:
    return np.concatenate([samples.switches.T, lines(samples.taxels), lines(samples.codes)]).T


def least_loss(X: np.ndarray, labels: np.ndarray) -> float:
    """Return the minimum of the penalised loss, by scikit-learn."""
    fit = LogisticRegression(C=1 / RIDGE, tol=1e-8, max_iter=5000).fit(X, labels)
    logs = fit.predict_log_proba(X)[np.arange(len(labels)), labels]
    return float(-logs.sum() + RIDGE / 2 * (fit.coef_**2).sum())


@settings(max_examples=4, deadline=None)
@given(SEEDS)
def test_the_loss_of_a_set_is_that_of_scikit_learn(seed: int) -> None:
    samples = drawn(seed)
    for number, found in SensorSearch(samples).sets(3).items():
        if number:
            exact = least_loss(inputs_of(samples)[:, list(found.sensors)], samples.labels)
            assert exact * (1 - 1e-9) <= found.loss <= exact * 1.002


@pytest.mark.parametrize("seed", range(3))
def test_of_all_sets_one_of_nearly_the_least_loss_is_found(seed: int) -> None:
    samples = drawn(seed, switches=3, pads=1)
    X, sets = inputs_of(samples), SensorSearch(samples).sets(3)
    for number in (1, 2, 3):
        least = min(least_loss(X[:, list(some)], samples.labels) for some in combinations(range(X.shape[1]), number))
        assert sets[number].loss <= least * 1.01


@settings(max_examples=4, deadline=None)
@given(SEEDS)
def test_more_sensors_lose_less_and_constant_ones_are_never_chosen(seed: int) -> None:
    samples = drawn(seed)
    switches, codes = samples.switches.copy(), samples.codes.copy()
    switches[:, 1], codes[:, 0] = True, 7
    samples = replace(samples, switches=switches, codes=codes)
    sets = SensorSearch(samples).sets(20)
    assert sorted(sets) == list(range(9))  # of ten, two are constant
    assert sets[8].loss < sets[4].loss < sets[0].loss
    assert sets[0].loss == pytest.approx(least_loss(np.zeros((90, 1)), samples.labels), rel=1e-6)
    for number, found in sets.items():
        assert len(set(found.sensors)) == number
        assert not {1, 7} & set(found.sensors)


@settings(max_examples=4, deadline=None)
@given(SEEDS, st.data())
def test_the_order_of_rows_does_not_matter(seed: int, data: st.DataObject) -> None:
    samples = drawn(seed)
    order = np.array(data.draw(st.permutations(range(len(samples.labels)))))
    one, other = (SensorSearch(rows).sets(4) for rows in (samples, samples.rows(order)))
    assert [found.sensors for found in one.values()] == [found.sensors for found in other.values()]
    assert [found.loss for found in one.values()] == [found.loss for found in other.values()]


@settings(max_examples=4, deadline=None)
@given(SEEDS, st.sets(st.integers(0, 9), max_size=3), st.sets(st.integers(0, 9), max_size=3))
def test_what_is_there_is_kept_and_what_cannot_be_is_not(seed: int, have: set[int], never: set[int]) -> None:
    never -= have
    search = SensorSearch(drawn(seed), tuple(have), tuple(never))
    for number, found in search.sets(6).items():
        assert number >= len(have)
        assert have <= set(found.sensors)
        assert not never & set(found.sensors)
        assert search.stand_ins(found)[: len(have)] == (None,) * len(have)


@settings(max_examples=8, deadline=None)
@given(SEEDS, st.lists(st.integers(1, 20), min_size=10, max_size=10), st.integers(1, 60))
def test_a_budget_is_kept_to_and_used(seed: int, prices: list[int], budget: int) -> None:
    search = SensorSearch(drawn(seed), prices=np.array(prices, np.float64), budget=float(budget))
    found = search.chosen(None)
    spent = sum(prices[sensor] for sensor in found.sensors)
    assert spent <= budget
    left = [price for sensor, price in enumerate(prices) if sensor not in found.sensors]
    # Near-equal sensors are exchanged for cheaper ones at the end, which may leave room for one more.
    assert not left or min(left) > budget - spent - 20


@pytest.mark.parametrize("seed", [4, 13])
def test_no_set_is_worse_than_a_larger_one_without_a_sensor(seed: int) -> None:
    samples = drawn(seed, n=120, switches=14, joints=2, classes=6)
    X, sets = inputs_of(samples), SensorSearch(samples).sets(6)
    for number in (3, 4, 5):
        rests = combinations(sets[number + 1].sensors, number)
        assert sets[number].loss <= min(least_loss(X[:, list(rest)], samples.labels) for rest in rests) * 1.002


def test_of_two_equal_sensors_the_cheaper_is_bought() -> None:
    samples = drawn(3)
    twice = replace(samples, codes=np.hstack([samples.codes, samples.codes]))
    dear_first = np.array([5.0] * 7 + [9.0] * 3 + [2.0] * 3)
    for prices in (dear_first, dear_first[[*range(7), 10, 11, 12, 7, 8, 9]]):
        found = SensorSearch(twice, prices=prices).chosen(5).sensors
        assert not [sensor for sensor in found if prices[sensor] == 9.0]


def test_a_number_has_the_same_sensors_alone_and_in_the_curve() -> None:
    samples = drawn(5)
    search = SensorSearch(samples)
    curve = search.sets(sensors.USUAL)
    assert [found.sensors for found in search.sets(sensors.USUAL).values()] == [each.sensors for each in curve.values()]
    for number in (1, 3, 6, 10):
        assert SensorSearch(samples).chosen(number).sensors == curve[number].sensors
    assert {*SensorSearch(samples).chosen(50).sensors} == {*range(10)}


def test_of_many_sensors_those_of_noise_are_dropped_first() -> None:
    random, labels = np.random.default_rng(9), np.arange(160) % 4
    telling = (random.random((4, 18)) < 0.5)[labels] ^ (random.random((160, 18)) < 0.2)
    noise = random.random((160, 6)) < 0.5
    search = SensorSearch(Samples(np.hstack([telling, noise]), np.zeros((160, 0), np.uint16), labels, tuple("abcd")))
    assert {*range(24)} - {*search.chosen(22).sensors} < {*range(18, 24)}


def test_a_stand_in_is_the_best_other_sensor() -> None:
    samples = drawn(4)
    search = SensorSearch(samples)
    found = search.sets(3)[3]
    for place, other in enumerate(search.stand_ins(found)):
        assert other is not None
        rest = [sensor for sensor in found.sensors if sensor != found.sensors[place]]
        assert set(rest) < set(other.sensors)
        losses = {
            sensor: least_loss(inputs_of(samples)[:, [*rest, sensor]], samples.labels)
            for sensor in range(10)
            if sensor not in found.sensors
        }
        assert losses[other.sensors[-1]] <= min(losses.values()) * (1 + NEAR)


@given(st.lists(st.integers(0, 65535), min_size=2, max_size=60))
def test_lines_are_deviations_from_the_mean_on_marks(column: list[int]) -> None:
    (line,) = lines(np.array(column, np.uint16)[:, np.newaxis])
    assert np.array_equal(line, np.rint(line * 2**MARK_BITS) / 2**MARK_BITS)
    deviation = np.std(column)
    expected = np.zeros(len(column)) if deviation == 0 else (np.array(column) - np.mean(column)) / deviation
    np.testing.assert_allclose(line, np.clip(expected, -8, 8), atol=0.5 / 2**MARK_BITS + 1e-9)
