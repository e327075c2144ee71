import math
from collections.abc import Callable
from itertools import product

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from thenar.runtime.live.decision import Standing
from thenar.runtime.scores import LiveScores, Scorer
from thenar.runtime.tables import IntegerTables

MakeTables = Callable[..., IntegerTables]
SWITCHES = 6

masks = st.integers(0, 63)


def every_completion(tables: IntegerTables, closed: int, unread: int) -> list[tuple[int, ...]]:
    """The scores of every state, open, closed or lost, of the unread switches."""
    scores, found = LiveScores(Scorer(tables)), []
    numbers = [number for number in range(SWITCHES) if unread >> number & 1]
    for state in product(range(3), repeat=len(numbers)):
        more = sum(1 << number for number, what in zip(numbers, state, strict=True) if what == 1)
        lost = sum(1 << number for number, what in zip(numbers, state, strict=True) if what == 2)
        found.append(scores.lanes(closed & ~unread | more, lost))
    return found


@given(
    seed=st.integers(0, 50), closed=st.integers(0, 63), unread=st.integers(0, 63).filter(lambda m: m.bit_count() < 5)
)
def test_with_unread_switches_it_says_what_holds_in_any_case(
    make_tables: MakeTables, seed: int, closed: int, unread: int
) -> None:
    tables = make_tables(seed, switches=SWITCHES)
    standing = Standing(LiveScores(Scorer(tables)).lanes(closed & ~unread), Scorer(tables), unread)
    whole = [Standing(lanes, Scorer(tables)) for lanes in every_completion(tables, closed, unread)]
    candidate = standing.candidate
    assert standing.certain == ({other.candidate for other in whole} == {candidate})
    for number in range(5):
        gaps = [other.lanes[candidate] - other.lanes[number] for other in whole]
        assert standing.lead(number) == min(gaps)
        for lead in (0, 40, 300):
            leads = [gap >= lead for gap in gaps]
            assert standing.contradicts(number, lead) == (number != candidate and any(leads))
        least = min(other.probability(number, 100.0) for other in whole)
        assert standing.probability(number, 100.0) <= least * (1 + 1e-12)
    if standing.certain:
        assert standing.margin == min(other.margin for other in whole)


@given(lanes=st.lists(st.integers(0, 65535), min_size=2, max_size=6).map(tuple))
def test_with_everything_read_it_says_what_the_scores_say(make_tables: MakeTables, lanes: tuple[int, ...]) -> None:
    standing = Standing(lanes, Scorer(make_tables()))
    assert standing.certain
    assert standing.candidate == int(np.argmax(lanes))
    assert standing.margin == np.diff(np.sort(lanes)[-2:])[0]
    assert [standing.lead(number) for number in range(len(lanes))] == [max(lanes) - lane for lane in lanes]
    total = math.fsum(standing.probability(number, 3.0) for number in range(len(lanes)))
    assert math.isclose(total, 1.0)


def test_a_probability_far_below_all_others_is_zero_and_no_error(make_tables: MakeTables) -> None:
    standing = Standing((0, 65535, 7), Scorer(make_tables()))
    assert [standing.probability(number, 1e-3) for number in range(3)] == [0.0, 1.0, 0.0]
