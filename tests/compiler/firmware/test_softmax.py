"""The softmax in integers is near the real one."""

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st
from mpmath import exp, mpf

from thenar.compiler.firmware.softmax import Softmax

SCORES = st.lists(st.integers(-32767, 32767), min_size=2, max_size=40)


@given(SCORES, st.floats(0.4, 40_000.0))
@example([0] * 40, 1.0)
@example([-32767, 32767], 0.4)
@example([-32767, 32767], 40_000.0)
def test_it_is_near_the_softmax_and_orders_classes_as_scores_do(scores: list[int], scale: float) -> None:
    found = Softmax(scale).probabilities(scores)
    odds = [exp(mpf(score - max(scores)) / mpf(scale)) for score in scores]
    assert all(abs(one - 65535 * odd / sum(odds)) < len(scores) + 4 for one, odd in zip(found, odds, strict=True))
    assert [found[k] for k in np.argsort(scores)] == sorted(found)
    assert min(found) >= 0
    assert max(found) <= 65535
