"""Scores of segmentations: small cases by hand, a slow reference, and what must hold of any."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.movements.segments import OVERLAPS, SegmentScore, levenshtein, score, segments_of

NONE = 3
STATES = st.lists(st.integers(0, NONE), min_size=1, max_size=40)


def spelled(text: str) -> list[int]:
    return [NONE if letter == "." else "abc".index(letter) for letter in text]


def f1(truth: str, found: str) -> tuple[float, ...]:
    counted = score(spelled(truth), spelled(found), NONE)
    return tuple(counted.f1(place) for place in range(len(OVERLAPS)))


def test_onset_and_end_are_of_segments_that_are_right() -> None:
    found = score(spelled("..aaaa..bbb."), spelled("...aaaa.cccc"), NONE)
    assert (found.onsets, found.ends, found.onset) == ((1,), (1,), 1)
    assert (found.true, found.found, found.recognised) == (2, 2, 1)


def test_latency_runs_from_the_beginning_to_the_announcement() -> None:
    truth, states = spelled("..aaaa..bbb.."), spelled("..aaaa..bbb..")
    late = spelled("....aaaa..bbb")
    assert score(truth, states, NONE, late).latencies == (2, 2)
    assert score(truth, states, NONE, spelled("a...aaaa....b")).latencies == (2, 4)
    # Announced before contact, and not again.
    early = score(truth, states, NONE, spelled(".aaaaa......."))
    assert (early.latencies, early.false) == ((-1,), 1)
    # A type that is announced at last, and one that never is.
    assert score(truth, states, NONE, spelled("..cccaaa.....")).latencies == (3,)


def test_false_are_segments_that_are_announced_while_nothing_is_held() -> None:
    truth = spelled("..aaaa.....bb")
    assert score(truth, truth, NONE, spelled("c.aaaa.b.a.bb")).false == 3
    assert score(truth, truth, NONE, spelled("..aacc.....bb")).false == 0
    assert score(truth, truth, NONE).false == 0


@given(STATES)
def test_the_truth_itself_is_perfect(states: list[int]) -> None:
    found = score(states, states, NONE, states)
    assert [found.f1(place) for place in range(3)] == [1, 1, 1]
    assert (found.edit, found.recognition) == (1, 1)
    assert not any((*found.onsets, *found.ends, *found.latencies, found.false))
    assert found.true == found.found == len(segments_of(states, NONE))


@given(st.data(), STATES)
def test_f1_is_that_of_a_search_over_all_pairs(data: st.DataObject, truth: list[int]) -> None:
    states = data.draw(st.lists(st.integers(0, NONE), min_size=len(truth), max_size=len(truth)))
    true, segments = segments_of(truth, NONE), segments_of(states, NONE)
    counted = score(truth, states, NONE)
    for place, least in enumerate(OVERLAPS):
        hit = set[int]()
        for one in segments:
            ticks = set(range(one.start, one.end))
            overlaps = []
            for other in true:
                theirs = set(range(other.start, other.end))
                overlaps.append(len(ticks & theirs) / len(ticks | theirs) if other.state == one.state else 0.0)
            best = int(np.argmax(overlaps)) if overlaps else 0
            if overlaps and overlaps[best] >= least / 100 and best not in hit:
                hit.add(best)
        assert counted.right[place] == len(hit)
    assert counted.right[0] >= counted.right[1] >= counted.right[2]
    assert len(counted.onsets) == len(counted.ends) == counted.right[0]


@given(st.lists(st.integers(0, 2), max_size=9), st.lists(st.integers(0, 2), max_size=9))
def test_levenshtein_is_that_of_the_recursion(one: list[int], other: list[int]) -> None:
    def distance(left: list[int], right: list[int]) -> int:
        table = {(i, 0): i for i in range(len(left) + 1)} | {(0, j): j for j in range(len(right) + 1)}
        for i in range(1, len(left) + 1):
            for j in range(1, len(right) + 1):
                same = table[i - 1, j - 1] + (left[i - 1] != right[j - 1])
                table[i, j] = min(same, table[i - 1, j] + 1, table[i, j - 1] + 1)
        return table[len(left), len(right)]

    assert levenshtein(one, other) == distance(one, other)


def test_scores_of_streams_add_up() -> None:
    one = score(spelled(".aa.bb"), spelled(".aa.cc"), NONE, spelled("..aa.c"))
    other = score(spelled("cc.."), spelled("cc.."), NONE, spelled("cc.."))
    total = SegmentScore.total([one, other])
    assert (total.true, total.found, total.right) == (3, 3, (2, 2, 2))
    assert total.f1(0) == pytest.approx(2 / 3)
    assert total.onsets == (*one.onsets, *other.onsets)
    assert total.edit == pytest.approx(1 - 1 / 3)
    assert SegmentScore.total([]) == SegmentScore()
