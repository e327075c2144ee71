"""The luck of the best of many: by counting all draws, by what must not change it, and of contenders of known worth."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thenar.compiler.evaluation.rates import Draws

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
