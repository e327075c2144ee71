"""Elimination on boosted tables: against the loss worked out plainly, and on sets whose best placement is known."""

import numpy as np
import numpy.typing as npt
import pytest

from thenar.compiler.boosting.boost import boost
from thenar.compiler.placement import boosted_elimination
from thenar.compiler.placement.boosted_elimination import boosted_elimination_order
from thenar.compiler.samples import Columns, Samples
from thenar.compiler.tables.collapse import collapse

Bits = npt.NDArray[np.bool_]
Codes = npt.NDArray[np.uint16]
Floats = npt.NDArray[np.float64]


def learning_of(switches: Bits, labels: npt.NDArray[np.intp], codes: Codes | None = None) -> Samples:
    none = np.zeros((len(labels), 0), np.uint16)
    return Samples(switches, none if codes is None else codes, labels, tuple(map(str, range(int(labels.max()) + 1))))


def noisy(seed: int, joints: int, switches: int = 11) -> Samples:
    random = np.random.default_rng(seed)
    labels = np.arange(160) % 5
    bits = (random.random((5, switches)) < 0.4)[labels] ^ (random.random((160, switches)) < 0.15)
    codes = (50 * labels[:, np.newaxis] + random.integers(0, 200, (160, joints))).astype(np.uint16)
    return learning_of(bits, labels, codes)


def plain_loss(scores: Floats, labels: npt.NDArray[np.intp]) -> float:
    shares = np.exp(scores) / np.exp(scores).sum(axis=1, keepdims=True)
    return float(-np.log(shares[np.arange(len(labels)), labels]).sum())


def plainly(learning: Samples) -> Columns:
    """Return the order found by scoring every row anew without each switch, one after the other."""
    left = list(range(learning.n_switches))
    gone: list[int] = []
    while len(left) > 1:
        bits = learning.switches[:, left]
        X = np.hstack([bits.astype(np.uint16), learning.codes])
        stumps, _ = boost(X, learning.labels, learning.n_classes, rounds=40, max_bins=8)
        tables = collapse(stumps, len(left))
        losses = []
        for place in range(len(left)):
            rows = tables.switch_rows.copy()
            rows[place] = 0.0
            scores = stumps.scores(X) - bits @ (tables.switch_rows - rows)
            losses.append(plain_loss(scores + bits[:, place].mean() * tables.switch_rows[place], learning.labels))
        cheapest = sorted(range(len(left)), key=lambda place: losses[place])[: max(1, int(0.12 * len(left)))]
        gone += [left[place] for place in cheapest]
        left = [column for column in left if column not in gone]
    return tuple(left + gone[::-1])


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "joints", "switches"), [(0, 0, 9), (1, 0, 9), (2, 2, 9), (3, 1, 25)])
def test_what_goes_is_what_raises_the_loss_least_when_its_mean_takes_its_place(
    seed: int, joints: int, switches: int
) -> None:
    learning = noisy(seed, joints, switches)
    assert boosted_elimination_order(learning) == plainly(learning)


def test_what_tells_the_classes_apart_stays_longest() -> None:
    random = np.random.default_rng(5)
    labels = np.arange(240) % 8
    switches = random.random((240, 22)) < 0.5
    for bit, column in enumerate((7, 13, 20)):
        switches[:, column] = (labels >> bit & 1).astype(bool) ^ (random.random(240) < 0.03)
    assert set(boosted_elimination_order(learning_of(switches, labels))[:3]) == {7, 13, 20}


def test_every_switch_that_varies_is_in_the_order_once() -> None:
    learning = noisy(4, 0)
    switches = learning.switches.copy()
    switches[:, [3, 9]] = True, False
    order = boosted_elimination_order(learning_of(switches, learning.labels))
    assert sorted(order) == [column for column in range(11) if column not in (3, 9)]


def test_switches_that_boosting_never_asks_for_go_by_their_numbers() -> None:
    labels = np.arange(120) % 4
    low, high = (labels & 1).astype(bool), (labels >> 1).astype(bool)
    copies = learning_of(np.stack([low, high, low, high, low], axis=1), labels)
    assert boosted_elimination_order(copies)[2:] == (4, 3, 2)


def test_what_the_joints_tell_no_switch_needs_to() -> None:
    random = np.random.default_rng(3)
    labels = np.arange(240) % 4
    low, high = (labels & 1).astype(bool), (labels >> 1).astype(bool)
    codes = np.where(random.random(240) < 0.03, 200, np.where(low, 300, 100)).astype(np.uint16)[:, np.newaxis]
    switches = np.stack([low ^ (random.random(240) < 0.05), high ^ (random.random(240) < 0.1)], axis=1)
    assert boosted_elimination_order(learning_of(switches, labels)) == (0, 1)
    assert boosted_elimination_order(learning_of(switches, labels, codes)) == (1, 0)


def test_more_go_at_once_only_while_many_are_left(monkeypatch: pytest.MonkeyPatch) -> None:
    sizes: list[int] = []
    costs = boosted_elimination._costs

    def counted(learning: Samples, left: npt.NDArray[np.intp]) -> Floats:
        sizes.append(len(left))
        return costs(learning, left)

    monkeypatch.setattr(boosted_elimination, "_costs", counted)
    boosted_elimination_order(noisy(6, 0, 40))
    assert sizes == [40, 36, 32, 29, 26, 23, 21, 19, 17, *range(15, 1, -1)]


@pytest.mark.parametrize("columns", [0, 1])
def test_nothing_that_varies_leaves_nothing_to_order(columns: int) -> None:
    learning = learning_of(np.ones((6, columns), np.bool_), np.arange(6) % 2)
    assert boosted_elimination_order(learning) == ()
