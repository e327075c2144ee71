"""Streams of a set: the newest row at each tick, and where one ends."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.movements.streams import PAUSE_US, streams_of
from thenar.compiler.recordings import RecordingError
from thenar.compiler.recordings.merging import merge

from .conftest import make_movements


def test_a_stream_of_each_subject_has_all_rows_in_order() -> None:
    grasp_set = make_movements()
    streams = streams_of(grasp_set)
    assert [stream.subject for stream in streams] == ["A", "B"]
    assert np.concatenate([stream.rows for stream in streams]).tolist() == list(range(len(grasp_set)))


def test_rows_without_times_are_ten_milliseconds_apart() -> None:
    grasp_set = make_movements("A")
    blind = replace(grasp_set, times_us=np.empty(0, np.int64))
    for tick_us in (10_000, 20_000, 5_000):
        (known,), (unknown,) = streams_of(grasp_set, tick_us), streams_of(blind, tick_us)
        assert known.rows.tolist() == unknown.rows.tolist()


@given(st.lists(st.integers(1, 40_000), min_size=1, max_size=40), st.integers(1000, 30_000))
def test_each_tick_has_the_newest_row(steps: list[int], tick_us: int) -> None:
    times = np.cumsum([7, *steps])
    grasp_set = replace(make_movements("A").rows(np.arange(len(times))), times_us=times)
    (stream,) = streams_of(grasp_set, tick_us)
    assert stream.start_us == 7
    for tick, row in enumerate(stream.rows.tolist()):
        assert row == max(one for one, at in enumerate(times.tolist()) if at <= 7 + tick * tick_us)
    assert times[-1] - tick_us < 7 + (len(stream.rows) - 1) * tick_us <= times[-1]


def test_a_stream_ends_before_a_pause_and_where_the_clock_starts_again() -> None:
    grasp_set = make_movements("A")
    times = grasp_set.times_us.copy()
    times[20:] += PAUSE_US
    times[40:] -= times[40]
    found = streams_of(replace(grasp_set, times_us=times))
    assert [stream.rows[0] for stream in found] == [0, 20, 40]
    assert found[2].start_us == 0
    assert [stream.continued for stream in found] == [False, True, True]


def test_a_clock_of_each_trial_starts_a_stream_with_it() -> None:
    grasp_set = make_movements("A")
    first = np.flatnonzero(np.diff(grasp_set.trials, prepend=-1))
    own = grasp_set.times_us - np.repeat(grasp_set.times_us[first], np.diff(first, append=len(grasp_set)))
    streams = streams_of(replace(grasp_set, times_us=own))
    assert [stream.rows[0] for stream in streams] == first.tolist()
    assert not any(stream.continued for stream in streams)


def test_sessions_are_streams_of_their_own() -> None:
    grasp_set = make_movements("A")
    sessions = np.where(np.arange(len(grasp_set)) < 60, "1", "2")
    assert [stream.session for stream in streams_of(replace(grasp_set, sessions=sessions))] == ["1", "2"]


def test_rows_that_are_trials_of_their_own_are_no_movements() -> None:
    grasp_set = make_movements()
    held = grasp_set.rows(np.unique(grasp_set.trial_ids, return_index=True)[1]).without_none()
    with pytest.raises(RecordingError, match="whole movements"):
        streams_of(held)
    with pytest.raises(RecordingError, match="separate trial"):
        streams_of(replace(grasp_set, independent=True))


def test_static_grasps_beside_movements_are_of_no_stream() -> None:
    grasp_set = make_movements()
    held = grasp_set.without_none()
    single = held.rows(np.unique(held.trial_ids, return_index=True)[1])
    numbers = 100 + np.arange(len(single))
    for subjects in (np.full(len(single), "C"), single.subjects):
        static = replace(single, subjects=subjects, trials=numbers, times_us=np.zeros(0, np.int64))
        mixed = merge({"static": static, "movements": grasp_set})
        found = streams_of(mixed)
        assert [stream.subject for stream in found] == ["A", "B"]
        for one, alone in zip(found, streams_of(grasp_set), strict=True):
            assert one.start_us == alone.start_us
            np.testing.assert_array_equal(one.rows - len(static), alone.rows)
