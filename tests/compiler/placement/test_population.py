"""Placements for a population whose subjects press different switches, and their refinement by exchanges."""

from dataclasses import replace

import numpy as np
import pytest

from thenar.compiler.placement import population
from thenar.compiler.placement.elements import Element, Elements, columns_of
from thenar.compiler.placement.inputs import PlacementError
from thenar.compiler.placement.placement import Aim
from thenar.compiler.placement.population import (
    EXCHANGES,
    Population,
    Refining,
    StudyOptions,
    rates,
    served,
    standard_placement,
)
from thenar.compiler.samples import Columns, Samples

TYPES, EACH = 4, 24
ODD = tuple(range(1, 40, 4))  # subjects whose hands press switches 2 and 3 instead of 0 and 1


def make_population(people: int = 40, odd: tuple[int, ...] = ODD) -> Population:
    random = np.random.default_rng(6)
    subjects = np.repeat(np.arange(people), EACH)
    labels = np.arange(people * EACH) % TYPES
    bits = random.random((len(labels), 8)) < 0.2
    told = np.stack([labels & 1, labels >> 1], axis=1).astype(bool) ^ (random.random((len(labels), 2)) < 0.02)
    others = np.isin(subjects, odd)
    bits[~others, 0:2] = told[~others]
    bits[others, 2:4] = told[others]
    return Population(
        Samples(bits, np.zeros((len(labels), 0), np.uint16), labels, tuple(map(str, range(TYPES)))), subjects
    )


TAKE = StudyOptions(keep=2, method="cmim", rows=600, rounds=10, repeats=2)


def test_two_switches_serve_the_many_and_four_serve_the_odd_ones_too() -> None:
    two, four = (
        standard_placement(make_population(), TAKE),
        standard_placement(make_population(), replace(TAKE, keep=4)),
    )
    assert set(four.columns) == {0, 1, 2, 3}
    assert set(two.columns) <= {0, 1, 2, 3}
    best = max(point.served.worst_tenth for point in four.curve)
    assert best > max(point.served.worst_tenth for point in two.curve)


def test_the_curve_rises_with_the_number_of_subjects_and_names_every_aim() -> None:
    found = standard_placement(make_population(odd=()), TAKE)
    assert (found.subjects, found.held_out) == (40, 8)
    assert [(point.subjects, point.aim) for point in found.curve] == [
        (size, aim) for size in (2, 5, 10, 20, 32) for aim in ("plain", "mean", "worst tenth")
    ]
    assert found.curve[-3].served.mean >= found.curve[0].served.mean > 0.9
    assert all(p.served.lowest <= p.served.worst_tenth <= p.served.mean for p in (*found.curve, *found.tried))


def test_the_aim_is_the_one_that_did_better_among_those_learnt_from() -> None:
    found = standard_placement(make_population(), TAKE)
    worth = {point.aim: point.served.worth for point in found.tried}
    assert worth[found.aim] == max(worth.values())


def test_nothing_is_learnt_from_held_out_subjects() -> None:
    whole = make_population()
    found = standard_placement(whole, TAKE)
    people = np.random.default_rng(TAKE.seed).permutation(np.arange(40))
    held_out = np.isin(whole.subjects, people[:8])
    spoilt = whole.samples.labels.copy()
    spoilt[held_out] = (spoilt[held_out] + 1) % TYPES
    other = standard_placement(replace(whole, samples=replace(whole.samples, labels=spoilt)), TAKE)
    assert other.tried == found.tried
    assert other.curve[-3].served.mean < 0.3 < found.curve[-3].served.mean


def test_any_number_of_processes_gives_the_same_answer() -> None:
    told: list[tuple[int, int]] = []
    one = standard_placement(make_population(16), TAKE, 1, lambda done, all_: told.append((done, all_)))
    assert one == standard_placement(make_population(16), TAKE, 2)
    assert told[-1][0] == told[-1][1] == len(told)


def test_few_subjects_are_refused() -> None:
    with pytest.raises(PlacementError, match="7 subject"):
        standard_placement(make_population(7), TAKE)


def test_rows_are_drawn_evenly_and_repeatably() -> None:
    drawn = make_population().drawn(400, 3)
    assert set(np.bincount(drawn.subjects).tolist()) == {10}
    assert np.array_equal(drawn.samples.switches, make_population().drawn(400, 3).samples.switches)
    assert len(make_population().drawn(10**6, 3).subjects) == 40 * EACH


def framed(whole: Population, frames: int) -> Population:
    """Return the population with `frames` of each row, which is a trial."""
    rows = np.repeat(np.arange(len(whole.subjects)), frames)
    return Population(replace(whole.samples.rows(rows), trials=rows), whole.subjects[rows])


def test_trials_are_drawn_whole() -> None:
    one, four = make_population().drawn(400, 3), framed(make_population(), 4).drawn(1600, 3)
    assert np.array_equal(four.samples.switches, np.repeat(one.samples.switches, 4, axis=0))
    assert set(np.unique(four.samples.trials, return_counts=True)[1].tolist()) == {4}
    assert set(np.bincount(framed(make_population(), 3).drawn(40 * 7, 3).subjects).tolist()) == {6}
    assert set(np.bincount(framed(make_population(), 9).drawn(40 * 7, 3).subjects).tolist()) == {9}


def test_a_rate_is_one_of_trials_each_recognised_as_most_of_its_frames() -> None:
    whole = make_population()
    three = framed(whole, 3)
    spoilt = three.samples.switches.copy()
    spoilt[::3] ^= True
    asked = replace(three, samples=replace(three.samples, switches=spoilt))
    assert np.array_equal(rates(whole, asked, elements(0, 1), 10), rates(whole, whole, elements(0, 1), 10))


def test_service_is_the_mean_the_worst_tenth_and_the_lowest() -> None:
    given = served(np.array([0.5, 0.7, *[0.9] * 18]))
    assert [given.mean, given.worst_tenth] == pytest.approx([0.87, 0.6])
    assert given.lowest == 0.5
    assert given.worth == pytest.approx((0.87 + 0.6) / 2)
    assert served(np.array([0.8, 0.4])).worst_tenth == 0.4


def test_rates_are_each_subjects_own() -> None:
    whole = make_population()
    found = rates(whole, whole, elements(0, 1), 10)
    assert found.shape == (40,)
    assert found[list(ODD)].max() < np.delete(found, ODD).min()


OF_EACH, PEOPLE = 40, 20
FEW = (3, 11)


@pytest.fixture
def _twenty_are_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(population, "ENOUGH_SUBJECTS", 8)


def edgy(people: int = PEOPLE) -> Population:
    """Return people whom switches 0 and 1 serve; a FEW of them press 0 at random, and 2 tells what 0 does of all, less
    well; 3 and above tell nothing.
    """
    random = np.random.default_rng(8)
    subjects = np.repeat(np.arange(people), OF_EACH)
    labels = np.arange(people * OF_EACH) % TYPES
    bits = random.random((len(labels), 7)) < 0.5
    low, high = (labels & 1).astype(bool), (labels >> 1).astype(bool)
    few = np.isin(subjects, FEW)
    bits[:, 0] = np.where(few, bits[:, 0], low)
    bits[:, 1] = high
    bits[:, 2] = low ^ (random.random(len(labels)) < 0.12)
    return Population(
        Samples(bits, np.zeros((len(labels), 0), np.uint16), labels, tuple(map(str, range(TYPES)))), subjects
    )


def elements(*columns: int) -> Elements:
    return tuple(map(Element, columns))


def refined(kept: Columns, spare: Columns, aim: Aim, people: int = PEOPLE) -> Columns:
    refining = Refining(edgy(people), elements(*kept), elements(*spare), rows=400, rounds=10, seed=1)
    return columns_of(refining.best(aim))


@pytest.mark.usefixtures("_twenty_are_enough")
@pytest.mark.parametrize(("aim", "wanted"), [("plain", {1, 4}), ("mean", {0, 1}), ("worst tenth", {1, 2})])
def test_each_aim_finds_the_exchange_that_serves_it(aim: Aim, wanted: set[int]) -> None:
    """Without 0 nobody is served well; 0 serves the many to perfection, 2 everybody almost so."""
    assert set(refined((1, 4), (0, 2, 5), aim)) == wanted


@pytest.mark.usefixtures("_twenty_are_enough")
def test_what_is_exchanged_takes_the_place_of_what_goes() -> None:
    assert refined((4, 1), (0, 5), "mean") == (0, 1)


@pytest.mark.usefixtures("_twenty_are_enough")
def test_a_placement_that_nothing_betters_stays_as_it_is() -> None:
    assert refined((1, 0), (3, 4, 5), "mean") == (1, 0)
    assert refined((1, 0), (), "worst tenth") == (1, 0)


@pytest.mark.usefixtures("_twenty_are_enough")
def test_only_the_edge_changes_and_only_so_often() -> None:
    assert refined((3, 4, 5, 6), (0, 1, 2), "mean")[:EXCHANGES] != (3, 4)
    kept = (3, 4, 5, 6)
    assert len(set(refined(kept, (0, 1, 2), "mean")) - set(kept)) == EXCHANGES
    assert refined((3, 0, 4, 1, 5), (2,), "worst tenth")[0] == 3


@pytest.mark.usefixtures("_twenty_are_enough")
def test_few_subjects_are_left_to_the_method() -> None:
    assert refined((1, 4), (0, 2), "mean", people=7) == (1, 4)
    assert refined((1, 4), (0, 2), "mean", people=8) == (1, 0)
