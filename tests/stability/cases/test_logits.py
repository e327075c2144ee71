"""The case of the additive logit: its reference, and that a fit that ends too early or leans on an order is found."""

from functools import partial
from typing import Any

import numpy as np
import pytest
from mpmath import mpf

from thenar.compiler.additive.logit import ColumnTables, fit_logit
from thenar.compiler.additive.pairs import fit_pairs
from thenar.stability.cases import logits
from thenar.stability.reference.boosting import mean_loss
from thenar.stability.reference.logit import Column, largest_derivative
from thenar.stability.reference.numbers import precisely


@precisely()
def test_the_derivative_is_that_of_the_loss() -> None:
    rng = np.random.default_rng(1)
    rows, labels, weights = rng.normal(size=(4, 3)), [0, 1, 2, 1, 0, 2], [1.0, 2.0, 1.0, 3.0, 1.0, 1.0]
    added, pulls, smoothness = [0, 1, -1, 2, 3, 3], [0.5, 1.0, 2.0, 0.1], [(0, 1, 3.0), (0, 3, 0.5), (2, 3, 1.5)]

    def loss(entries: Any) -> Any:
        scores = [[mpf(0)] * 3 if row < 0 else list(entries[row]) for row in added]
        total = mean_loss(scores, labels, weights) * sum(weights)
        total += sum(pull * sum(each**2 for each in row) for pull, row in zip(pulls, entries, strict=True)) / 2
        pairs = [(s, entries[one], entries[other]) for one, other, s in smoothness]
        return total + sum(s * sum((b - a) ** 2 for a, b in zip(one, two, strict=True)) for s, one, two in pairs) / 2

    def slope(row: int, k: int) -> Any:
        def moved(by: Any) -> Any:
            entries = [[mpf(each) for each in own] for own in rows.tolist()]
            entries[row][k] += by
            return loss(entries)

        step = mpf(10) ** -20
        return (moved(step) - moved(-step)) / (2 * step)

    true = max(abs(slope(row, k)) for row in range(4) for k in range(3))
    found = largest_derivative([Column(added, rows.tolist(), pulls, smoothness)], labels, weights)
    assert abs(found - true) < mpf(10) ** -30


def _failing() -> set[str]:
    return {finding.check.split(",")[0] for finding in logits.findings(full=False) if not finding.holds}


def test_a_fit_that_ends_too_early_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(logits, "fit_logit", partial(fit_logit, tolerance=1e-5))
    monkeypatch.setattr(logits, "fit_pairs", partial(fit_pairs, tolerance=1e-5))
    assert _failing() >= {"largest derivative at the solution", "largest derivative with pairs of joints"}


def test_a_fit_that_hangs_on_the_order_of_rows_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def leaning(X: Any, labels: Any, *args: Any, **named: Any) -> ColumnTables:
        found = fit_logit(X, labels, *args, **named)
        return ColumnTables(found.bias * (1 + 2.0**-40 * labels[0]), found.edges, found.rows)

    monkeypatch.setattr(logits, "fit_logit", leaning)
    assert "solutions changed by the order of rows or a constant column" in _failing()
