"""Ranges over the rounds: what the picture of ten thousand of them shows."""

import pytest

from thenar.stability.inputs.hard_data import separable
from thenar.stability.shown.figures import ranges_of


def test_ranges_are_those_of_every_round() -> None:
    seen = ranges_of(separable(33), 50)
    assert len(seen.losses) == len(seen.mean_scores) == len(seen.least_weight) == 50
    assert seen.greatest_probability[-1] == 1.0
    assert 0 < seen.least_probability[-1] < 1e-15
    assert max(seen.greatest_weight) <= 1 / 3
    assert max(seen.mean_scores) < 50 * (33 + 6) * 2.0**-53 * 3
    assert seen.losses[0] > seen.losses[-1] == pytest.approx(0.0, abs=1e-15)
