import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.evaluation.ablation import change_of

Outcomes = st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=300)


@given(Outcomes)
def test_a_change_lies_in_its_interval_and_that_within_what_is_possible(outcomes: list[tuple[bool, bool]]) -> None:
    now, before = np.array(outcomes, dtype=bool).T
    found = change_of(now, before)
    assert found.mean == pytest.approx(now.mean() - before.mean(), abs=1e-12)
    assert -1.0 <= found.low <= found.mean <= found.high <= 1.0
    opposite = change_of(before, now)
    assert (opposite.low, opposite.high) == pytest.approx((-found.high, -found.low))


def test_the_interval_is_the_one_of_agresti_and_min() -> None:
    # Their example (2005, table I; also Agresti, Categorical Data Analysis, 10.1): approval of a prime minister by 1600
    # people, asked twice: 794 and 570 kept their mind, 150 and 86 changed it.
    now = np.repeat([True, True, False, False], [794, 86, 150, 570])
    before = np.repeat([True, False, True, False], [794, 86, 150, 570])
    found = change_of(now, before)
    assert found.mean == pytest.approx(-0.04)
    assert (found.low, found.high) == pytest.approx((-0.0587, -0.0212), abs=2e-4)


def test_the_interval_covers_the_true_change_as_often_as_it_says() -> None:
    random = np.random.default_rng(11)
    covered = 0
    for _ in range(1000):
        before = random.random(60) < 0.9
        now = np.where(random.random(60) < 0.15, random.random(60) < 0.7, before)
        covered += (found := change_of(now, before)).low <= 0.15 * (0.7 - 0.9) <= found.high
    assert covered > 930
