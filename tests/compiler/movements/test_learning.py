"""Segment models learnt from streams: what is counted, and what they decode."""

import numpy as np
import pytest

from thenar.compiler.movements.segments import Counts, learnt, live_states, model_of, score
from thenar.compiler.movements.streams import streams_of
from thenar.runtime.segmenting.decoder import decode, emissions
from thenar.runtime.segmenting.model import STEPS

from .conftest import make_movements


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


@pytest.mark.parametrize("lag", [0, 1, 15, 10_000])
def test_live_states_are_one_a_tick_and_at_last_the_offline_ones(lag: int) -> None:
    grasp_set = make_movements("A")
    model = model_of(Counts.of([grasp_set.labels], 3), 0.25, 0.0, 2.0, 100.0, 10_000)
    lanes = np.rint(100 * unsure(grasp_set.labels, 3)).astype(np.int64)
    states = live_states(model, lanes, lag)
    assert len(states) == len(lanes)
    offline = decode(model, emissions(lanes, model))
    assert states.tolist() == offline.tolist() if lag == 10_000 else states[-1] == offline[-1]
