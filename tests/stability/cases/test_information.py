"""Gains, entropies and choices for counts that hypothesis finds; and faults that are noticed."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thenar.compiler.placement import gain
from thenar.compiler.placement.cooccurrence import Cooccurrence
from thenar.stability.cases import information
from thenar.stability.inputs.hard_data import bit_set

COUNTS = st.integers(0, 30) | st.integers(0, 10**9) | st.sampled_from([10**9 - 1, 10**9])
TABLES = arrays(np.int64, st.tuples(st.integers(1, 6), st.integers(2, 4)), elements=COUNTS).filter(np.any)
PAIRS = st.tuples(
    arrays(np.int64, (3, 2), elements=st.integers(1, 10**9)), arrays(np.int64, (3, 1), elements=st.integers(-1, 1))
)


@given(TABLES)
def test_gain_and_entropy_are_within_what_rounding_allows(table: np.ndarray) -> None:
    assert information.gains_of([table]).holds
    assert information.entropies_of([table]).holds


@given(PAIRS)
def test_one_count_in_a_billion_decides_as_whole_numbers_do(pair: tuple[np.ndarray, np.ndarray]) -> None:
    one, moved = pair
    # Columns change places and a count or none moves: equal gains, or next to equal ones.
    other = np.maximum(one[:, ::-1] + np.hstack([moved, -moved]), 0)
    other[:, 0] += one.sum(axis=1) - other.sum(axis=1)
    assert information.comparisons_of([(one, other)]).holds
    assume(other.sum(axis=0).all())  # an input that does not vary is none to choose
    assert information.choices_of([(one, other)]).holds


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32))
def test_what_a_bit_tells_given_another_is_within_what_rounding_allows(seed: int) -> None:
    rng = np.random.default_rng(seed)
    drawn = bit_set(rng)
    assert information.given_of([drawn]).holds
    assert information.given_comparisons_of([drawn], rng).holds


def float_score(table: np.ndarray) -> float:
    return float(
        sum(m * math.log(m) for m in table.ravel() if m) - sum(m * math.log(m) for m in table.sum(axis=0) if m)
    )


class Careless(Cooccurrence):
    """Works in single precision, and compares in floating point."""

    def information(self, given: int | None = None) -> np.ndarray:
        return super().information(given).astype(np.float32)

    def sign(self, one: tuple[int, int | None], other: tuple[int, int | None]) -> int:
        return int(np.sign(super().information(one[1])[one[0]] - super().information(other[1])[other[0]]))


def test_every_finding_notices_a_small_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(information, "gain_bits", lambda table: gain.gain_bits(table) + 1e-13)
    monkeypatch.setattr(information, "entropy_bits", lambda totals: gain.entropy_bits(totals) * (1 + 2.0**-45))
    monkeypatch.setattr(information, "compare_scores", lambda a, b: int(np.sign(float_score(a) - float_score(b))))
    monkeypatch.setattr(
        information,
        "best_position",
        lambda node, columns: int(np.argmax([float_score(node.table(p)) for p in range(len(columns))])),
    )
    monkeypatch.setattr(information, "Cooccurrence", Careless)
    assert not [finding.check for finding in information.findings(False) if finding.holds]
