"""Levels of taxels: splits of most information, held against scikit-learn and against every split there is."""

from itertools import pairwise
from math import log2

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given
from sklearn.tree import DecisionTreeClassifier

from thenar.compiler.placement.elements import Element, bits_of, elements_of, ports_of
from thenar.compiler.placement.elements import levels_of as levels_of_taxels
from thenar.compiler.placement.methods.base import METHODS
from thenar.compiler.placement.ports import PortCosts
from thenar.compiler.samples import Samples, TrainingError


def samples_of(codes: list[int], labels: list[int]) -> Samples:
    none = np.zeros((len(codes), 0))
    taxels = np.array(codes, np.uint16)[:, np.newaxis]
    return Samples(none.astype(bool), none.astype(np.uint16), np.array(labels), tuple("012"), taxels=taxels)


def levels_of(codes: list[int], labels: list[int], most: int) -> tuple[int, ...]:
    return levels_of_taxels(np.array(codes, np.uint16)[:, np.newaxis], np.array(labels), 3, most)[0]


def entropy(labels: list[int]) -> float:
    shares = [labels.count(label) / len(labels) for label in set(labels)]
    return -sum(share * log2(share) for share in shares)


def remaining(codes: list[int], labels: list[int], threshold: int) -> float:
    sides = [[label for code, label in zip(codes, labels, strict=True) if (code > threshold) == up] for up in (0, 1)]
    return sum(len(side) * entropy(side) for side in sides if side)


# Of so few rows of each type nobody knows the noise at rest.
CODES = st.lists(st.sampled_from([0, 1, 2, 7, 8, 300, 65535]), max_size=7)
ROWS = (
    st.tuples(CODES, CODES, CODES)
    .map(lambda own: [(code, label) for label in range(3) for code in own[label]])
    .filter(bool)
)


@pytest.mark.parametrize("seed", range(20))
def test_scikit_learn_splits_a_taxel_at_the_same_place(seed: int) -> None:
    random = np.random.default_rng(seed)
    labels = random.integers(0, 3, 200)
    codes = np.clip(400 * labels + random.normal(300, 250, 200), 0, 4095).astype(np.uint16)
    (found,) = levels_of(codes.tolist(), labels.tolist(), 1)
    stump = DecisionTreeClassifier(criterion="entropy", max_depth=1, random_state=0).fit(codes[:, None], labels)
    assert found == int(stump.tree_.threshold[0])


def test_of_exact_ties_the_lowest_is_taken_where_floating_point_sees_none() -> None:
    """Splits of mirrored counts tell equally much."""
    codes, labels = [0, 10, 20, 30], [0, 1, 1, 0]
    assert levels_of(codes, labels, 1) == (5,)
    assert levels_of(codes, labels, 9) == (5, 25)


@given(
    seed=st.integers(0, 2**32 - 1), rest=st.integers(0, 60), noise=st.floats(3.0, 12.0), pressed=st.integers(900, 3000)
)
def test_no_level_lies_in_the_noise_of_rest(seed: int, rest: int, noise: float, pressed: int) -> None:
    """Type 0 rests, type 1 presses in a third of its rows, type 2 in all; noise is cut off at 0."""
    random = np.random.default_rng(seed)
    labels = np.repeat(np.arange(3), 60)
    share = random.random(180) < np.array([0.0, 1 / 3, 1.0])[labels]
    quiet = np.clip(np.rint(random.normal(rest, noise, 180)), 0, None)
    codes = np.where(share, np.rint(random.uniform(pressed, 4000, 180)), quiet).astype(int)
    quiet = quiet.astype(int)
    found = levels_of(codes.tolist(), labels.tolist(), 7)
    assert quiet[~share].mean() + 1.5 * noise < found[0]
    assert found[-1] < codes.max()
    falling = levels_of((4095 - codes).tolist(), labels.tolist(), 7)
    assert max(falling) < 4095 - quiet[~share].mean() - 1.5 * noise


def test_a_taxel_of_which_nobody_knows_whether_it_rests_keeps_all_levels() -> None:
    random = np.random.default_rng(5)
    codes = np.rint(random.uniform(100, 4000, 300)).astype(int).tolist()
    lowest, second, *_ = sorted(set(codes))
    assert min(levels_of(codes, [row % 3 for row in range(300)], 65535)) == (lowest + second) // 2


def test_thresholds_of_the_training_rows_make_switches_of_all_rows() -> None:
    whole = samples_of([0, 4, 10, 20, 7, 8], [0, 0, 1, 1, 0, 1])
    elements = elements_of(whole.rows(np.arange(4)), 1)
    assert elements == (Element(0, 7),)
    plain = bits_of(whole, elements)
    assert plain.switches[:, 0].tolist() == [False, False, True, True, False, True]
    assert plain.inputs.shape == (6, 1)
    assert bits_of(plain, elements_of(plain)) is plain
    with pytest.raises(TrainingError, match="taxels are no inputs"):
        _ = whole.inputs


@given(ROWS, st.integers(1, 5))
def test_levels_are_the_splits_of_the_interval_that_then_tells_most(rows: list[tuple[int, int]], most: int) -> None:
    """An oracle of every split of every interval, at each step, finds the same levels; more of them hold the fewer."""
    codes, labels = map(list, zip(*rows, strict=True))
    found = levels_of(codes, labels, most)
    assert list(found) == sorted(set(found))
    assert len(found) <= most
    assert set(levels_of(codes, labels, max(most - 1, 1))) <= set(found)
    taken: list[int] = []
    middles = [(low + high) // 2 for low, high in pairwise(sorted(set(codes)))]

    def left(thresholds: list[int]) -> float:
        return sum(
            remaining([code for code, _ in part], [label for _, label in part], -1)
            for part in ([row for row in rows if sum(row[0] > one for one in thresholds) == n] for n in range(9))
        )

    for _ in found if middles else ():
        kept = left(taken)
        gains = {middle: kept - left([*taken, middle]) for middle in middles if middle not in taken}
        best = max(gains.values())
        best_of = [middle for middle in gains if gains[middle] > best - 1e-9]
        (new,) = {one for one in found if one not in taken} & {best_of[0]}
        taken.append(new)
    if taken and len(found) < most:
        assert all(left(taken) - left([*taken, middle]) < 1e-9 for middle in middles)


def test_every_method_chooses_levels_and_a_taxel_pays_once() -> None:
    """Two levels of one taxel tell three grasp types apart: they cost one conversion, levels of two taxels two."""
    random = np.random.default_rng(0)
    labels = np.arange(90) % 3
    codes = np.column_stack([1000 * labels, 400 * (labels == 2), 7 * (labels == 0)]) + random.integers(0, 5, (90, 3))
    whole = Samples(
        np.zeros((90, 1), bool), np.zeros((90, 0), np.uint16), labels, tuple("012"), taxels=codes.astype(np.uint16)
    )
    elements = elements_of(whole)
    assert {element.column for element in elements} == {0, 1, 2, 3}
    bits = bits_of(whole, elements)
    ports = ports_of(PortCosts((0, 1, 2, 3), (5.0, 100.0, 100.0, 100.0)), elements)
    assert [ports.port_of[place] for place, element in enumerate(elements) if element.column == 1] == [1, 1]
    for name, method in METHODS.items():
        if method.by_number:
            kept = [elements[place] for place in method.chooser(bits, ports)(2)]
            assert kept, name
    for name in ("id3-cost", "elimination-cost"):
        kept = [elements[place] for place in METHODS[name].chooser(bits, ports)(2)]
        assert {element.column for element in kept} == {1}, name
