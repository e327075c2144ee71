"""Weights and responses for probabilities and scores that hypothesis finds; and faults that are noticed."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thenar.compiler.boosting import exactsums
from thenar.stability.cases import targets

P = st.floats(0.0, 1.0) | st.sampled_from([0.0, 5e-324, 2.0**-53, 1 - 2.0**-53, 1.0, 1 / 3, 1 - 1 / 3])
SIZES = st.floats(-1e300, 1e300) | st.floats(-1e-300, 1e-300) | st.floats(-1.0, 1.0) | st.just(0.0)


@given(st.floats(1.0, 100.0, exclude_min=True), arrays(np.float64, 3, elements=P))
def test_weights_and_responses_given_p_are_within_their_roundings(z_max: float, p: np.ndarray) -> None:
    assert all(finding.holds for finding in targets.given_probabilities([(z_max, p)]))


def test_the_truth_of_a_response_is_not_rounded() -> None:
    p, u = 0.3333333333333332, 3.0
    exact = Fraction(u) * (1 - Fraction(p))
    off = abs(Fraction(u * (1.0 - p)) - exact) / exact * 2**53
    _, responses, _ = targets.given_probabilities([(3.0, np.array([p]))])
    assert responses.error == pytest.approx(float(off), rel=1e-9, abs=0)


@given(arrays(np.float64, st.tuples(st.integers(2, 5), st.just(2)), elements=st.floats(-1e3, 1e3)))
def test_weights_and_responses_given_scores_are_within_what_rounding_allows(scores: np.ndarray) -> None:
    assert targets.given_scores([scores]).holds


@given(arrays(np.float64, st.tuples(st.integers(1, 3), st.integers(1, 40)), elements=SIZES))
def test_two_grids_hold_numbers_of_all_sizes(values: np.ndarray) -> None:
    assert all(finding.holds for finding in targets.grids_of([values]))


def test_every_finding_notices_a_small_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    def unclamped(p: np.ndarray, member: np.ndarray, z_max: float, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        own = np.where(member, p, 1.0 - p)
        sizes = np.where(member, 1.0 - p, p) * u
        return sizes * own, np.where(member, sizes, -sizes) * (1 + 2.0**-51)

    def off_a_quarter(values: np.ndarray) -> tuple[exactsums.OnGrid, exactsums.OnGrid]:
        coarse, fine = exactsums.on_grids(values)
        return exactsums.OnGrid(coarse.units + 0.25, coarse.exponents), fine

    def coarser(values: np.ndarray) -> tuple[exactsums.OnGrid, exactsums.OnGrid]:
        coarse, fine = exactsums.on_grids(values)
        return coarse, exactsums.OnGrid(np.rint(fine.units / 4) * 4, fine.exponents)

    monkeypatch.setattr(targets, "weights_and_responses", unclamped)
    monkeypatch.setattr(targets, "on_grids", coarser)
    found = {finding.check for finding in targets.findings(False) if finding.holds}
    monkeypatch.setattr(targets, "on_grids", off_a_quarter)
    found &= {finding.check for finding in targets.findings(False) if finding.holds}
    assert not found
