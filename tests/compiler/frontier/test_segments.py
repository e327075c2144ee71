"""Segments on the latency axis: learnt from the training movements alone, with tables that know nothing held."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from thenar.compiler.frontier.latency import latencies, latency, movements_of, segment_tables
from thenar.compiler.frontier.replay import replay_of
from thenar.compiler.placement.elements import Element
from thenar.compiler.placement.placement import InputSelection
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.samples import Samples
from thenar.compiler.trainers.base import Training
from thenar.runtime.published import NONE
from thenar.runtime.recipe import Recipe
from thenar.runtime.segmenting.model import SegmentModel

from ..conftest import make_set

BEFORE, HELD, AFTER = 20, 30, 10
RECIPE = Recipe(rounds=5)
KEPT = InputSelection.of(tuple(map(Element, range(14))), (0, 1, 2))


def movements(subjects: int = 2) -> GraspSet:
    """Return twelve movements of three types, in turn by each subject: open, held, open again, 10 ms a frame."""
    random = np.random.default_rng(7)
    parts = np.tile(np.repeat([True, False, True], (BEFORE, HELD, AFTER)), 12)
    frames = make_set(rows=12, types=3, subjects=subjects, frames=BEFORE + HELD + AFTER)
    switches = (frames.switches & ~parts[:, None]) ^ (random.random(frames.switches.shape) < 0.05)
    codes = np.where(parts[:, None], 1, frames.codes) + random.integers(0, 9, frames.codes.shape)
    return replace(
        frames,
        switches=switches,
        codes=codes.astype(np.uint16),
        grasps=np.where(parts, NONE, frames.grasps),
        times_us=10_000 * np.arange(len(frames)),
    )


def held_by(grasp_set: GraspSet, *subjects: str) -> np.ndarray:
    held = grasp_set.without_none()
    return np.flatnonzero(np.isin(held.subjects, subjects))


def test_a_left_out_subject_takes_no_part_in_learning() -> None:
    grasp_set = movements()
    new = grasp_set.subjects == "S1"
    random = np.random.default_rng(1)
    changed = replace(
        grasp_set,
        switches=np.where(new[:, None], random.random(grasp_set.switches.shape) < 0.5, grasp_set.switches),
        codes=np.where(new[:, None], 7, grasp_set.codes).astype(np.uint16),
    )
    training = Training.of(RECIPE)
    found = []
    for one in (grasp_set, changed):
        moving = movements_of(one, held_by(one, "S0"))
        assert moving is not None
        assert sum(len(stream.rows) for stream in moving[1]) >= np.count_nonzero(~new)
        assert {stream.subject for stream in moving[1]} == {"S0"}
        made, model = segment_tables(moving, 1, KEPT, [RECIPE], training)[RECIPE]
        found.append((made.switch_rows.tobytes(), made.scale, model))
    assert found[0] == found[1]
    model = found[0][2]
    # Half of the shortest that was seen.
    assert model.least == (HELD // 2,) * 3 + ((BEFORE + AFTER) // 2,)
    assert model != SegmentModel.usual(3, has_none=True, scale=found[0][1])


def test_no_stream_goes_over_a_movement_that_is_left_out() -> None:
    grasp_set = movements(subjects=1)
    trials = grasp_set.without_none().trials
    moving = movements_of(grasp_set, np.flatnonzero((trials != 3) & (trials != 4)))
    assert moving is not None
    assert [len(stream.rows) // 60 for stream in moving[1]] == [3, 7]
    assert [stream.start_us for stream in moving[1]] == [0, 5 * 600_000]
    assert np.concatenate([stream.rows for stream in moving[1]]).tolist() == list(range(600))


@pytest.mark.parametrize("change", [{"independent": True}, {"none": False}])
def test_sets_without_streams_or_none_teach_no_segments(change: dict[str, Any]) -> None:
    grasp_set = make_set(rows=12) if "none" in change else replace(movements(), **change)
    assert movements_of(grasp_set, np.arange(6)) is None


def test_only_segments_use_learnt_costs_and_the_class_none() -> None:
    grasp_set = movements()
    held, training = Samples.of(grasp_set.without_none()), Training.of(RECIPE)
    train, new = held_by(grasp_set, "S0"), np.flatnonzero(grasp_set.subjects == "S1")
    labels = np.where(grasp_set.is_none, -1, np.searchsorted(np.unique(grasp_set.labels), grasp_set.labels))
    replay = replay_of(grasp_set, labels, new, seed=1)
    frames = ((RECIPE, 3000.0),)
    moving = movements_of(grasp_set, train)
    assert moving is not None
    ((*others, segments),) = latencies(held, train, KEPT, replay, frames, training, moving)
    ((*before, usual),) = latencies(held, train, KEPT, replay, frames, training)
    assert others == before
    made, model = segment_tables(moving, 1, KEPT, [RECIPE], training)[RECIPE]
    assert made.n_classes == held.n_classes + 1
    assert segments == latency(made, replay, 3000.0, model)
    assert segments != usual
    assert segments.missed == 0
    assert segments.wrong == 0
