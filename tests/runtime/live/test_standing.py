import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from thenar.runtime.live.decision import Ranking


@given(scores=st.lists(st.integers(0, 65535), min_size=2, max_size=6).map(tuple))
def test_it_says_what_the_scores_say(scores: tuple[int, ...]) -> None:
    standing = Ranking(scores)
    assert standing.candidate == int(np.argmax(scores))
    assert standing.margin == np.diff(np.sort(scores)[-2:])[0]
    assert [standing.lead(number) for number in range(len(scores))] == [max(scores) - lane for lane in scores]
    for number in range(len(scores)):
        assert standing.contradicts(number, 5) == (scores[number] + 5 <= max(scores) and number != standing.candidate)
    total = math.fsum(standing.probability(number, 3.0) for number in range(len(scores)))
    assert math.isclose(total, 1.0)


def test_a_probability_far_below_all_others_is_zero_and_no_error() -> None:
    standing = Ranking((0, 65535, 7))
    assert [standing.probability(number, 1e-3) for number in range(3)] == [0.0, 1.0, 0.0]
