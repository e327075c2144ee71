import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from thenar.runtime.live.decision import Ranking


@given(lanes=st.lists(st.integers(0, 65535), min_size=2, max_size=6).map(tuple))
def test_it_says_what_the_scores_say(lanes: tuple[int, ...]) -> None:
    standing = Ranking(lanes)
    assert standing.candidate == int(np.argmax(lanes))
    assert standing.margin == np.diff(np.sort(lanes)[-2:])[0]
    assert [standing.lead(number) for number in range(len(lanes))] == [max(lanes) - lane for lane in lanes]
    for number in range(len(lanes)):
        assert standing.contradicts(number, 5) == (lanes[number] + 5 <= max(lanes) and number != standing.candidate)
    total = math.fsum(standing.probability(number, 3.0) for number in range(len(lanes)))
    assert math.isclose(total, 1.0)


def test_a_probability_far_below_all_others_is_zero_and_no_error() -> None:
    standing = Ranking((0, 65535, 7))
    assert [standing.probability(number, 1e-3) for number in range(3)] == [0.0, 1.0, 0.0]
