"""Baselines beside their definitions, with information as exact products of whole numbers."""

from collections import Counter
from fractions import Fraction
from itertools import islice
from math import prod
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.placement.gain import Cooccurrence
from thenar.compiler.placement.methods import baselines
from thenar.compiler.placement.methods.baselines import cmim, most_informative, random_placement
from thenar.compiler.samples import TrainingError

Bits = npt.NDArray[np.bool_]
Data = tuple[Bits, npt.NDArray[np.int64]]


@st.composite
def data(draw: st.DrawFn) -> Data:
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n, d, classes = draw(st.integers(1, 24)), draw(st.integers(1, 7)), draw(st.integers(1, 4))
    return random.random((n, d)) < random.choice([0.1, 0.5]), random.integers(0, classes, n)


def forward_cmim(X: Bits, y: npt.NDArray[np.int64], m: int) -> tuple[int, ...]:
    return tuple(islice(cmim(X, y), m))


def top_mutual_information(X: Bits, y: npt.NDArray[np.int64], m: int) -> tuple[int, ...]:
    return most_informative(X, y)[:m]


def power(*columns: npt.NDArray[Any]) -> int:
    """Return the product of m ^ m over the counts m of equal rows: e to the power of n times their information."""
    return prod(m**m for m in Counter(zip(*(column.tolist() for column in columns), strict=True)).values())


def information(y: npt.NDArray[np.int64], a: Bits, b: Bits) -> Fraction:
    """Return e to the power of n * I(y; a | b)."""
    return Fraction(power(y, a, b) * power(b), power(a, b) * power(y, b))


def varying(X: Bits) -> list[int]:
    return [column for column in range(X.shape[1]) if 0 < X[:, column].sum() < len(X)]


def cmim_by_definition(X: Bits, y: npt.NDArray[np.int64], m: int) -> tuple[int, ...]:
    none = np.zeros(len(y), bool)
    rest = varying(X)
    chosen: list[int] = []
    scores = {a: information(y, X[:, a], none) for a in rest}
    while rest and len(chosen) < m:
        best = max(rest, key=lambda a: scores[a])
        rest.remove(best)
        chosen.append(best)
        scores = {a: min(scores[a], information(y, X[:, a], X[:, best])) for a in rest}
    return tuple(chosen)


@given(data(), st.integers(0, 8))
def test_forward_selection_is_fleurets_definition(drawn: Data, m: int) -> None:
    X, y = drawn
    assert forward_cmim(X, y, m) == cmim_by_definition(X, y, m)


@given(data(), st.integers(0, 8))
def test_the_top_ones_are_sorted_by_information_then_number(drawn: Data, m: int) -> None:
    X, y = drawn
    none = np.zeros(len(y), bool)
    wanted = sorted(varying(X), key=lambda a: (-information(y, X[:, a], none), a))
    assert top_mutual_information(X, y, m) == tuple(wanted[:m])


class Rough(Cooccurrence):
    """Floating-point information that is off by as much as its bound admits, as it might be on another machine."""

    def __init__(self, X: Bits, labels: npt.NDArray[np.intp], n_classes: int) -> None:
        super().__init__(X, labels, n_classes)
        self.error_bound = 0.5
        self.random = np.random.default_rng(len(X))

    def information(self, given: int | None = None) -> npt.NDArray[np.float64]:
        exact = super().information(given)
        return exact + self.random.uniform(-0.5, 0.5, exact.shape)


@given(data(), st.integers(0, 8))
def test_rounding_within_its_bound_decides_nothing(drawn: Data, m: int) -> None:
    X, y = drawn
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(baselines, "Cooccurrence", Rough)
        rough = forward_cmim(X, y, m), top_mutual_information(X, y, m)
    assert rough == (forward_cmim(X, y, m), top_mutual_information(X, y, m))


@given(st.integers(0, 200), st.integers(0, 250), st.integers(0, 9))
def test_a_random_placement_is_different_inputs_drawn_by_the_seed(n_inputs: int, m: int, seed: int) -> None:
    drawn = random_placement(n_inputs, m, seed)
    assert len(set(drawn)) == len(drawn) == min(m, n_inputs)
    assert set(drawn) <= set(range(n_inputs))
    assert random_placement(n_inputs, m, seed) == drawn


def test_a_negative_size_is_refused() -> None:
    with pytest.raises(TrainingError, match="-1 inputs were requested"):
        random_placement(5, -1, 0)
