"""Refusing frames: live ones as whole arrays, and what is lost never speaks against a grasp."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from thenar.runtime.manifest import Rejection
from thenar.runtime.scores import LANE_OFFSET, Rejector, refused

K, S, J = 3, 6, 4


@st.composite
def _rejections(draw: st.DrawFn) -> Rejection:
    def pair(most: int) -> tuple[int, int]:
        low, high = sorted(draw(st.tuples(st.integers(0, most), st.integers(0, most))))
        return low, high

    return Rejection(
        share=0.01,
        least_scores=tuple(draw(st.integers(-40, 40)) for _ in range(K)),
        closed=tuple(pair(S) for _ in range(K)),
        ranges=tuple(tuple(pair(20) for _ in range(J)) for _ in range(K)),
        outside=draw(st.integers(0, J)),
    )


_masks, _codes = st.integers(0, (1 << S) - 1), st.lists(st.integers(0, 20), min_size=J, max_size=J)
_scores = st.lists(st.integers(-60, 60), min_size=K, max_size=K)


@given(_rejections(), _scores, _masks, _codes)
def test_a_live_frame_is_refused_as_a_row_of_an_array_is(
    rejection: Rejection, scores: list[int], closed: int, codes: list[int]
) -> None:
    lanes = [score + LANE_OFFSET for score in scores]
    bits = np.array([[closed >> number & 1 for number in range(S)]], bool)
    (expected,) = refused(rejection, np.array([scores]), bits, np.array([codes]))
    assert Rejector(rejection).refuses(lanes, closed.bit_count(), 0, codes) == expected


@given(_rejections(), _scores, _masks, _masks, _codes, st.integers(0, (1 << J) - 1))
def test_a_lost_input_refuses_only_if_every_value_would(
    rejection: Rejection, scores: list[int], closed: int, lost: int, codes: list[int], joints: int
) -> None:
    rejector, lanes = Rejector(rejection), [score + LANE_OFFSET for score in scores]
    best = scores.index(max(scores))
    # Of what is not whole the score is not judged.
    judging = Rejector(replace(rejection, least_scores=(-100,) * K)) if lost or joints else rejector
    sure = [number for number in range(S) if lost >> number & 1]
    states = [closed & ~lost | sum(1 << n for n in sure[:count]) for count in range(len(sure) + 1)]
    likely = [rejection.ranges[best][joint][0] if joints >> joint & 1 else code for joint, code in enumerate(codes)]
    possible = [judging.refuses(lanes, state.bit_count(), 0, likely) for state in states]
    counts = (closed & ~lost).bit_count(), lost.bit_count()
    assert rejector.refuses(lanes, *counts, codes, lost_joints=joints) == all(possible)


@given(_rejections(), _scores, _masks, _masks)
def test_joints_and_scores_that_are_not_whole_are_not_judged(
    rejection: Rejection, scores: list[int], closed: int, lost: int
) -> None:
    best, lanes = scores.index(max(scores)), [score + LANE_OFFSET for score in scores]
    seen = (closed & ~lost).bit_count()
    found = Rejector(rejection).refuses(lanes, seen, lost.bit_count(), None)
    narrow = Rejector(replace(rejection, ranges=((),) * K))
    whole = narrow.refuses(lanes, seen, lost.bit_count(), [])
    fewest, most = rejection.closed[best]
    beyond = seen > most or seen + lost.bit_count() < fewest
    assert found == beyond
    assert whole == (beyond or (not lost and scores[best] < rejection.least_scores[best]))
