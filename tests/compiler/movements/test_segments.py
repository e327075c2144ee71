"""Scores of segmentations, by hand, by a slow reference, by what must hold of any; and models learnt from streams."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.movements.segments import (
    OVERLAPS,
    Counts,
    SegmentScore,
    learnt,
    levenshtein,
    live_states,
    model_of,
    score,
    segments_of,
)
from thenar.compiler.movements.streams import streams_of
from thenar.runtime.errors import BuildError
from thenar.runtime.segmenting.model import STEPS, SegmentModel

from .conftest import make_movements

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


def test_durations_and_changes_are_counted_without_what_is_cut_off() -> None:
    truth = np.array([2, 2, 0, 0, 0, 2, 1, 0, 0, 2])
    counts = Counts.of([truth, np.array([0, 0, 0])], 2)
    assert counts.durations == ((3, 2), (1,), (1,))
    assert counts.changes.tolist() == [[0, 0, 2], [1, 0, 0], [1, 1, 0]]


def test_costs_are_of_what_was_counted() -> None:
    ticks = [0] * 100 + [1] * 100
    truth = np.concatenate([np.array([2] * 40 + ticks[:60] + [2] * 40 + ticks[100:160]) for _ in range(6)])
    model = model_of(Counts.of([truth], 2), 0.5, 0.0, 0.0, 256.0, 10_000)
    assert model.least == (30, 30, 20)
    # A mean of 30 ticks beyond the shortest: half a step a tick.
    assert model.stay == (round(STEPS * np.log(31 / 30)),) * 2 + (round(STEPS * np.log(21 / 20)),)
    assert model.enter == (round(STEPS * np.log(2)),) * 2
    assert min(model.direct) > max(model.enter) > max(model.leave)
    dearer = model_of(Counts.of([truth], 2), 0.5, 2.0, 3.0, 256.0, 10_000)
    assert [cost - old for cost, old in zip(dearer.enter, model.enter, strict=True)] == [3 * STEPS] * 2
    assert dearer.stay[2] == model.stay[2] + STEPS
    assert model_of(Counts.of([truth], 2), 0.5, -2.0, 0.0, 256.0, 10_000).stay[0] == model.stay[0] + STEPS


def test_models_of_what_nobody_has_seen_are_models() -> None:
    nothing = model_of(Counts.of([], 3), 0.25, 1.0, 2.0, 300.0, 10_000)
    assert nothing.least == (1,) * 4
    assert len(set(nothing.enter)) == 1


def unsure(labels: np.ndarray, seed: int) -> np.ndarray:
    """Return scores of which a third favours a class drawn at random."""
    random = np.random.default_rng(seed)
    classes = int(labels.max()) + 1
    seen = np.where(random.random(len(labels)) < 0.33, random.integers(0, classes, len(labels)), labels)
    return 3.0 * np.eye(classes)[seen] + random.normal(0, 0.5, (len(labels), classes))


def test_a_model_that_was_learnt_finds_segments_in_unsure_scores() -> None:
    grasp_set, other = make_movements(), make_movements("C", seed=2)
    streams = streams_of(grasp_set)
    model = learnt(streams, grasp_set.labels, unsure(grasp_set.labels, 1), 3, 100.0, 10_000)
    lanes = np.rint(100 * unsure(other.labels, 2)).astype(np.int64)
    raw, found = (score(other.labels, states, 3) for states in (lanes.argmax(axis=1), live_states(model, lanes, 15)))
    assert raw.f1(2) < 0.3
    assert found.f1(2) > 0.95
    assert found.onset <= 3
    again = learnt(streams, grasp_set.labels, unsure(grasp_set.labels, 1), 3, 100.0, 10_000)
    assert again == model


def test_scores_of_other_classes_are_refused() -> None:
    model = SegmentModel.usual(3, True, 100.0)
    with pytest.raises(BuildError, match=r"scores have shape \(2, 3\), but the segment model takes 4 a frame"):
        live_states(model, np.zeros((2, 3), int), 1)


@pytest.mark.parametrize("lag", [0, 1, 15, 10_000])
def test_live_states_are_one_a_tick_and_at_last_the_offline_ones(lag: int) -> None:
    grasp_set = make_movements("A")
    model = model_of(Counts.of([grasp_set.labels], 3), 0.25, 0.0, 2.0, 100.0, 10_000)
    lanes = np.rint(100 * unsure(grasp_set.labels, 3)).astype(np.int64)
    states = live_states(model, lanes, lag)
    assert len(states) == len(lanes)
    offline = live_states(model, lanes, len(lanes))
    assert states.tolist() == offline.tolist() if lag == 10_000 else states[-1] == offline[-1]
