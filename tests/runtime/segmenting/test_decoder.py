"""The decoder against every segmentation of small streams, and against a textbook's Viterbi."""

from itertools import groupby, pairwise, product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.strategies import DrawFn
from numpy.typing import NDArray

from thenar.drivers.errors import SettingError
from thenar.runtime.segmenting.decoder import Decoder, frame_costs
from thenar.runtime.segmenting.model import SegmentModel

Segments = list[tuple[int, int]]


def costs_of(model: SegmentModel, lanes: NDArray[np.int64], refused: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the costs of frames, (T, K + 1)."""
    return np.array([frame_costs(model, row, no) for row, no in zip(lanes.tolist(), refused.tolist(), strict=True)])


def decoded(model: SegmentModel, lanes: NDArray[np.int64], refused: NDArray[np.bool_]) -> list[int]:
    """Return the states of the cheapest segmentation of a whole stream."""
    decoder = Decoder(model, len(lanes))
    for row, no in zip(lanes.tolist(), refused.tolist(), strict=True):
        decoder.push(row, no)
    return decoder.finish()


@st.composite
def _models(draw: DrawFn) -> SegmentModel:
    n_types = draw(st.integers(1, 3))
    cost = st.integers(0, draw(st.sampled_from([0, 1, 12])))

    def costs(more: int = 0) -> tuple[int, ...]:
        return tuple(draw(st.lists(cost, min_size=n_types + more, max_size=n_types + more)))

    return SegmentModel(
        shift=0,
        gain=256,
        most=draw(st.integers(1, 20)),
        least=tuple(draw(st.lists(st.integers(1, 4), min_size=n_types + 1, max_size=n_types + 1))),
        stay=costs(1),
        enter=costs(),
        leave=costs(),
        direct=costs(),
        refusal=draw(st.none() | cost),
    )


@st.composite
def _streams(draw: DrawFn, longest: int = 8) -> tuple[SegmentModel, NDArray[np.int64], NDArray[np.bool_]]:
    """Return a model, scores, which frames are refused; of small costs and scores, many paths cost the same."""
    model = draw(_models())
    ticks = draw(st.integers(1, longest if model.n_types < 3 else longest - 2))
    score = st.integers(0, draw(st.sampled_from([0, 1, 20])))
    lanes = draw(st.lists(st.lists(score, min_size=4, max_size=4), min_size=ticks, max_size=ticks))
    refused = draw(st.lists(st.booleans(), min_size=ticks, max_size=ticks))
    return model, np.array(lanes)[:, : model.n_lanes], np.array(refused) & (model.refusal is not None)


def _segments(states: tuple[int, ...]) -> Segments:
    """Return each segment's state and first tick."""
    found, tick = [], 0
    for state, run in groupby(states):
        found.append((state, tick))
        tick += len(list(run))
    return found


def _cost(model: SegmentModel, states: tuple[int, ...], segments: Segments, costs: NDArray[np.int64]) -> int | None:
    """Return what a segmentation costs as the model's text says it; None where a segment inside is too short."""
    none = model.n_types
    for (state, start), (_, end) in pairwise(segments[1:]):
        if end - start < model.least[state]:
            return None
    total = sum(int(costs[tick, state]) + model.stay[state] for tick, state in enumerate(states))
    for (before, _), (after, _) in pairwise(segments):
        total += model.enter[after] if before == none else model.leave[before] if after == none else model.direct[after]
    return total


def _best(model: SegmentModel, costs: NDArray[np.int64]) -> tuple[int, tuple[int, ...]]:
    """Return the least cost, and of all the segmentations that cost it the one that wins."""
    found = []
    for states in product(range(model.n_types + 1), repeat=len(costs)):
        segments = _segments(states)
        if (cost := _cost(model, states, segments, costs)) is not None:
            found.append((cost, segments[::-1], states))
    cost, _, states = min(found)
    return cost, states


def test_of_the_cheapest_segmentations_of_tiny_streams_the_documented_one_wins() -> None:
    random = np.random.default_rng(1)

    def costs(number: int) -> tuple[int, ...]:
        return tuple(random.integers(0, 2, number).tolist())

    for _ in range(1200):
        least = tuple(random.integers(1, 3, 4).tolist())
        model = SegmentModel(
            shift=0, gain=256, most=1, least=least, stay=costs(4), enter=costs(3), leave=costs(3), direct=costs(3)
        )
        lanes, none = random.integers(0, 2, (4, 4)), np.zeros(4, bool)
        assert tuple(decoded(model, lanes, none)) == _best(model, costs_of(model, lanes, none))[1]


@given(_streams(), st.integers(0, 9))
def test_live_ticks_follow_the_best_path_with_documented_ties(
    stream: tuple[SegmentModel, NDArray[np.int64], NDArray[np.bool_]], lag: int
) -> None:
    model, lanes, refused = stream
    costs, decoder = costs_of(model, lanes, refused), Decoder(model, lag)
    grasps, state = 0, model.n_types
    for now, (row, no) in enumerate(zip(lanes.tolist(), refused.tolist(), strict=True)):
        found, path = decoder.push(row, no), _best(model, costs[: now + 1])[1]
        expected = path[now - lag] if now >= lag else model.n_types
        grasps += expected not in (state, model.n_types)
        state = expected
        assert (found.tick, found.state, found.segment) == (now - lag, expected, grasps)
        assert (found.newest, found.newest_start) == _segments(path)[-1]
        if now >= lag:
            assert (found.state, found.start) == [each for each in _segments(path) if each[1] <= now - lag][-1]
    assert tuple(decoder.finish()) == path[-lag:] * (lag > 0)


def test_without_durations_it_is_a_textbooks_viterbi_on_a_long_stream() -> None:
    random = np.random.default_rng(1)
    n_types, ticks = 4, 3000
    model = SegmentModel(
        shift=0,
        gain=200,
        most=90,
        least=(1,) * 5,
        stay=(0, 1, 2, 0, 1),
        enter=(40, 31, 77, 52),
        leave=(23, 29, 61, 20),
        direct=(83, 97, 45, 131),
    )
    truth = np.repeat(random.integers(0, n_types + 1, ticks // 30), 30)
    lanes = random.integers(0, 100, (ticks, n_types + 1)) + 60 * (truth[:, np.newaxis] == np.arange(n_types + 1))
    none = np.zeros(ticks, bool)
    costs = costs_of(model, lanes, none)
    change = np.tile([*model.direct, 0], (n_types + 1, 1))
    change[n_types, :n_types], change[:n_types, n_types] = model.enter, model.leave
    np.fill_diagonal(change, 0)
    paid = costs + np.array(model.stay)
    total, came = paid[0], []
    for row in paid[1:]:
        each = total[:, np.newaxis] + change
        came.append(each.argmin(axis=0))
        total = each.min(axis=0) + row
    states = [int(total.argmin())]
    for sources in reversed(came):
        states.append(int(sources[states[-1]]))
    path = np.array(states[::-1])
    found = np.array(decoded(model, lanes, none))

    def cost(each: NDArray[np.integer]) -> int:
        return int(paid[np.arange(ticks), each].sum() + change[each[:-1], each[1:]].sum())

    assert cost(found) == cost(path) == total.min()
    assert (found == path).mean() > 0.99
    assert len(_segments(tuple(path.tolist()))) > 50


def test_a_negative_lag_is_refused() -> None:
    with pytest.raises(SettingError, match="a lag of -1 ticks"):
        Decoder(SegmentModel.usual(3, True, 100.0), -1)
