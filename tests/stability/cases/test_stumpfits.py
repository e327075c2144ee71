"""Stumps of weights, responses and columns that hypothesis finds; and faults that are noticed."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thenar.compiler.boosting.boost import boost
from thenar.compiler.boosting.stumpfit import FittedStumps, Targets, fit_stumps
from thenar.stability.cases import stumpfits
from thenar.stability.cases import stumpfits as trainings
from thenar.stability.cases.stumpfits import Problem

CELLS = st.sampled_from([0.0, 1.0, 1.0 + 2.0**-52, 5.0, -3.0, np.nan])
WEIGHTS = st.floats(0.0, 1.0) | st.floats(1e-300, 1e-290) | st.sampled_from([0.0, 5e-324, 2.0**-52, 2.0**-38, 1.0])
RATIOS = st.floats(1.0, 3.0) | st.floats(-3.0, -1.0) | st.sampled_from([-3.0, -1.0, 1.0, 3.0])


@st.composite
def problems(draw: st.DrawFn) -> Problem:
    n = draw(st.integers(2, 12))
    X = draw(arrays(np.float64, (n, draw(st.integers(1, 4))), elements=CELLS))
    X[:2, 0] = 0.0, 1.0
    weights, ratios = draw(arrays(np.float64, n, elements=WEIGHTS)), draw(arrays(np.float64, n, elements=RATIOS))
    return Problem("drawn", X, weights, weights * np.where(weights < 1e-300, np.rint(ratios), ratios))


@settings(deadline=None)
@given(problems())
def test_no_stump_explains_more_and_branches_answer_with_their_means(problem: Problem) -> None:
    fits = [(problem, stumpfits.fit(problem))]
    assert stumpfits.choices_of(fits).holds
    # Not every problem has a branch that is, or is not, next to empty.
    assert all(finding.error <= finding.bound for finding in stumpfits.outputs_of(fits))


def test_every_finding_notices_a_small_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    def off(binned: Any, targets: Targets, z_max: float) -> FittedStumps:
        stumps = fit_stumps(binned, targets, z_max)
        return replace(stumps, values=stumps.values * (1 + 2.0**-50))

    def one_row_turned(weights: np.ndarray, responses: np.ndarray) -> Targets:
        return Targets(weights, np.where(np.arange(responses.shape[1]) == 0, -responses, responses))

    def with_a_heavier_row(X: Any, y: Any, K: int, **options: Any) -> Any:
        return boost(X, y, K, **options, weights=np.where(np.arange(len(y)) == 0, 3.0, 1.0))

    monkeypatch.setattr(stumpfits, "midpoints", lambda values: values[1:])
    monkeypatch.setattr(stumpfits, "fit_stumps", off)
    monkeypatch.setattr(stumpfits, "Targets", one_row_turned)
    monkeypatch.setattr(trainings, "boost", with_a_heavier_row)
    assert not [finding.check for finding in stumpfits.findings(False) if finding.holds]
