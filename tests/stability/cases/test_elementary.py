"""Shares, losses and sums within what rounding allows, for scores that hypothesis finds; faults are noticed."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thenar.compiler import elementary as ours
from thenar.stability.cases import elementary

FAR = st.floats(-1e4, 1e4) | st.sampled_from([0.0, 1e4, -1e4, 5e-324, 1.0 + 2.0**-52, 36.7, 745.0])
SCORES = arrays(np.float64, st.tuples(st.integers(2, 6), st.integers(1, 3)), elements=FAR)


@given(SCORES)
def test_shares_are_within_what_rounding_allows(scores: np.ndarray) -> None:
    assert elementary.shares_of([scores]).holds


@given(SCORES, st.data())
def test_losses_are_within_what_rounding_allows_however_they_are_weighted(
    scores: np.ndarray, data: st.DataObject
) -> None:
    n = scores.shape[1]
    labels = data.draw(arrays(np.intp, n, elements=st.integers(0, len(scores) - 1)))
    weights = data.draw(st.none() | arrays(np.float64, n, elements=st.floats(2.0**-900, 2.0**900)))
    assert elementary.losses_of([(scores, labels, weights)]).holds


@given(
    st.floats(690.0, 770.0),
    st.lists(st.tuples(st.floats(0.0, 800.0), st.booleans(), st.integers(-1080, 0)), min_size=1, max_size=5),
    st.integers(-1000, 1000),
)
@example(740.0, [(760.0, False, -1073)], 200)  # just heavy enough for a double
@example(740.0, [(760.0, False, -1074)], 200)
@example(700.0, [(700.0, True, 0)], -900)
def test_losses_next_to_the_smallest_double_are_within_what_underflow_allows(
    sure: float, light: list[tuple[float, bool, int]], heaviest: int
) -> None:
    """One heavy row that is next to certain, and rows so light that weight, product or mean underflows."""
    gaps = [sure, *(gap if right else -gap for gap, right, _ in light)]
    weights = np.ldexp(1.0, [heaviest, *(max(heaviest + power, -1074) for _, _, power in light)])
    scores = np.array([gaps, np.zeros(len(gaps))])
    assert elementary.losses_of([(scores, np.zeros(len(gaps), np.intp), weights)]).holds


@given(arrays(np.float64, st.tuples(st.integers(2, 33), st.just(1)), elements=st.floats(-1e300, 1e300)))
def test_sums_over_classes_are_within_a_rounding_an_addition(column: np.ndarray) -> None:
    assert elementary.sums_of([column]).holds


@given(arrays(np.float64, st.integers(1, 300), elements=st.floats(1e-3, 1e3)))
def test_sums_over_rounds_round_once(terms: np.ndarray) -> None:
    assert elementary.long_sums_of([("drawn", terms)]).holds


def test_every_finding_notices_a_small_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(elementary, "exp", lambda x: np.nextafter(ours.exp(x), np.inf) + np.spacing(ours.exp(x)))
    monkeypatch.setattr(elementary, "log", lambda x: ours.log(x) * (1 + 2.0**-50))
    monkeypatch.setattr(elementary, "sincos", lambda x: tuple(part * (1 + 2.0**-50) for part in ours.sincos(x)))
    monkeypatch.setattr(elementary, "softmax", lambda F: ours.softmax(F) * (1 + 2.0**-46))
    monkeypatch.setattr(elementary, "add_up", lambda rows: rows.sum(axis=0) * (1 + 2.0**-50))
    monkeypatch.setattr(elementary, "add_exactly", lambda total, carry, term: (total + term, carry))

    def from_shares(F: np.ndarray, labels: np.ndarray, weights: np.ndarray | None) -> tuple[np.ndarray, float]:
        P = ours.softmax(F)
        return P, float(np.average(-np.log(np.maximum(P[labels, np.arange(labels.size)], 1e-320)), weights=weights))

    monkeypatch.setattr(elementary, "softmax_and_loss", from_shares)
    assert not [finding.check for finding in elementary.findings(False) if finding.holds]
