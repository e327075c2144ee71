"""What elimination keeps of sets whose best placement is known, and that it hangs on nothing else."""

import numpy as np
import numpy.typing as npt
import pytest

from thenar.compiler.placement import elimination
from thenar.compiler.placement.costaware import PortCosts
from thenar.compiler.placement.elimination import elimination_order
from thenar.compiler.samples import Samples

Bits = npt.NDArray[np.bool_]


def learning_of(switches: Bits, labels: npt.NDArray[np.intp], codes: npt.NDArray[np.uint16] | None = None) -> Samples:
    none = np.zeros((len(labels), 0), np.uint16)
    return Samples(switches, none if codes is None else codes, labels, tuple(map(str, range(int(labels.max()) + 1))))


@pytest.fixture(autouse=True)
def _few_are_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(elimination, "FINE", 8)


def planted(seed: int, noise: int = 22) -> Samples:
    """Return eight classes that switches 7, 13 and 20 tell apart, among others that tell nothing."""
    random = np.random.default_rng(seed)
    labels = np.arange(240) % 8
    switches = random.random((240, noise)) < 0.5
    for bit, column in enumerate((7, 13, 20)):
        switches[:, column] = (labels >> bit & 1).astype(bool) ^ (random.random(240) < 0.03)
    return learning_of(switches, labels)


@pytest.mark.parametrize("seed", range(3))
def test_what_tells_the_classes_apart_stays_longest(seed: int) -> None:
    assert set(elimination_order(planted(seed))[:3]) == {7, 13, 20}


def test_every_switch_that_varies_is_in_the_order_once() -> None:
    learning = planted(1)
    switches = learning.switches.copy()
    switches[:, [3, 9]] = True, False
    order = elimination_order(learning_of(switches, learning.labels))
    assert sorted(order) == [column for column in range(22) if column not in (3, 9)]


def test_the_order_of_the_rows_does_not_matter() -> None:
    learning = planted(2)
    shuffled = learning.rows(np.random.default_rng(0).permutation(240))
    assert elimination_order(shuffled) == elimination_order(learning)


def test_of_two_equal_switches_one_goes_before_any_that_is_needed_and_it_is_the_lower_number() -> None:
    labels = np.arange(120) % 4
    low, high = (labels & 1).astype(bool), (labels >> 1).astype(bool)
    assert elimination_order(learning_of(np.stack([low, low, high, high], axis=1), labels))[:2] in ((1, 3), (3, 1))


def test_trying_sees_that_others_stand_in(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two switches that are told by others jointly look dear one by one; fitted on without them, they are not."""
    random = np.random.default_rng(4)
    labels = np.arange(400) % 4
    low, high = (labels & 1).astype(bool), (labels >> 1).astype(bool)
    switches = np.stack([low, high, low, low ^ (random.random(400) < 0.05)], axis=1)
    order = elimination_order(learning_of(switches, labels))
    assert set(order[:2]) in ({0, 1}, {1, 2})
    monkeypatch.setattr(elimination, "CANDIDATES", 1)
    assert set(elimination_order(learning_of(switches, labels))[:2]) <= {0, 1, 2}


def test_what_the_joints_tell_no_switch_needs_to() -> None:
    random = np.random.default_rng(3)
    labels = np.arange(240) % 4
    low, high = (labels & 1).astype(bool), (labels >> 1).astype(bool) ^ (random.random(240) < 0.1)
    codes = np.where(low, 300, 100).astype(np.uint16)[:, np.newaxis]
    switches = np.stack([low, high], axis=1)
    assert elimination_order(learning_of(switches, labels)) == (0, 1)
    assert elimination_order(learning_of(switches, labels, codes)) == (1, 0)


def test_of_switches_as_good_those_whose_ports_are_needed_anyway_stay() -> None:
    labels = np.arange(160) % 4
    low, high = (labels & 1).astype(bool), (labels >> 1).astype(bool)
    low_again = low.copy()
    low_again[:1] ^= True
    learning = learning_of(np.stack([low, high, low_again], axis=1), labels)
    assert set(elimination_order(learning)[:2]) == {0, 1}
    assert set(elimination_order(learning, PortCosts((0, 1, 1), (50.0, 50.0)))[:2]) == {1, 2}


@pytest.mark.parametrize("columns", [0, 1])
def test_nothing_that_varies_leaves_nothing_to_order(columns: int) -> None:
    learning = learning_of(np.ones((6, columns), np.bool_), np.arange(6) % 2)
    assert elimination_order(learning) == ()
