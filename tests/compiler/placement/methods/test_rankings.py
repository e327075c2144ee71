"""The baselines: what each ranks first, and what all of them keep to."""

import numpy as np
import pytest

from thenar.compiler.placement.methods.base import METHODS
from thenar.compiler.samples import Samples

BASELINES = [name for name, method in METHODS.items() if not method.ours]
TELLING = (7, 2, 5)


def told_by_three(rows: int = 240, switches: int = 12, types: int = 8) -> Samples:
    """Three switches spell the type out; two never change; the others are noise."""
    random = np.random.default_rng(3)
    labels = np.arange(rows) % types
    bits = random.random((rows, switches)) < 0.3
    for place, column in enumerate(TELLING):
        bits[:, column] = (labels >> place) & 1
    bits[:, 0], bits[:, 11] = False, True
    return Samples(bits, np.zeros((rows, 0), np.uint16), labels, tuple(map(str, range(types))))


@pytest.fixture(scope="module")
def learning() -> Samples:
    return told_by_three()


@pytest.mark.parametrize("name", ["cmim", "mutual-information"])
def test_who_looks_at_labels_finds_the_switches_that_tell_the_types(name: str, learning: Samples) -> None:
    assert set(METHODS[name].chooser(learning)(3)) == set(TELLING)


@pytest.mark.parametrize("name", BASELINES)
def test_placements_are_nested_repeatable_and_of_switches_that_vary(name: str, learning: Samples) -> None:
    choose, again = METHODS[name].chooser(learning), METHODS[name].chooser(learning)
    everything = choose(100)
    assert sorted(everything) == list(range(1, 11))
    for m in range(12):
        assert choose(m) == again(m) == everything[:m]


@pytest.mark.parametrize("name", BASELINES)
def test_where_nothing_varies_or_one_type_is_left_nothing_is_chosen(name: str, learning: Samples) -> None:
    still = Samples(np.ones((6, 3), bool), np.zeros((6, 0), np.uint16), np.arange(6) % 2, tuple("01"))
    alike = Samples(learning.switches, learning.codes, np.zeros(len(learning.labels), np.intp), tuple("01"))
    assert METHODS[name].chooser(still)(2) == METHODS[name].chooser(alike)(2) == ()


def test_conditional_information_drops_the_copy_that_information_alone_keeps() -> None:
    random = np.random.default_rng(1)
    labels = np.arange(400) % 4
    strong, weak = (labels & 1).astype(bool), (labels >> 1).astype(bool) ^ (random.random(400) < 0.15)
    copy = strong ^ (random.random(400) < 0.1)
    learning = Samples(np.column_stack([strong, copy, weak]), np.zeros((400, 0), np.uint16), labels, tuple("0123"))
    assert set(METHODS["cmim"].chooser(learning)(2)) == {0, 2}
    assert set(METHODS["mutual-information"].chooser(learning)(2)) == {0, 1}
