import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.runtime import Build, FrameError, Recognizer
from thenar.runtime.manifest import Manifest
from thenar.runtime.recognizer import Frame
from thenar.runtime.tables import IntegerTables

MakeTables = Callable[..., IntegerTables]
Describe = Callable[[IntegerTables], Manifest]


@pytest.fixture(scope="module")
def loaded(make_tables: MakeTables, describe: Describe) -> Build:
    tables = make_tables()
    return Build(describe(tables), tables)


def _frame(seed: int) -> Frame:
    random = np.random.default_rng(seed)
    return Frame(seed, random.random(9) < 0.5, random.integers(0, 256, 3).astype(np.uint16))


def _lost(frame: Frame) -> Frame:
    return replace(frame, lost_switches=np.ones(9, bool), lost_joints=np.ones(3, bool))


@given(seed=st.integers(0, 10_000))
def test_a_recognition_says_what_the_scores_say(loaded: Build, seed: int) -> None:
    frame = _frame(seed)
    scores = loaded.scores(frame.bits, frame.codes)
    found = Recognizer(loaded).recognise(frame)
    assert found.time_us == seed
    assert found.grasp == loaded.classify(frame.bits, frame.codes)
    assert found.margin == np.diff(np.sort(scores)[-2:])[0]
    softmax = np.exp(scores / 100.0) / np.exp(scores / 100.0).sum()
    assert math.isclose(found.probability, softmax.max(), rel_tol=1e-9)
    assert not found.degraded


def test_a_lost_input_is_replaced_by_its_mean_and_the_frame_is_degraded(loaded: Build) -> None:
    frame = _frame(1)
    lost = np.arange(9) == 4
    found = Recognizer(loaded).recognise(replace(frame, lost_switches=lost))
    lanes = loaded.lanes_without(frame.bits, frame.codes, lost, np.zeros(3, bool))
    assert found.degraded
    assert found.grasp == loaded.grasps[int(np.argmax(lanes))]
    assert found.margin == np.diff(np.sort(lanes)[-2:])[0]


def test_what_a_lost_input_reads_does_not_matter(loaded: Build) -> None:
    frame, recognizer = _frame(2), Recognizer(loaded)
    other = replace(_frame(3), time_us=2)
    assert recognizer.recognise(_lost(frame)) == recognizer.recognise(_lost(other))


def test_masks_that_mark_nothing_change_nothing(loaded: Build) -> None:
    frame = _frame(4)
    masked = replace(frame, lost_switches=np.zeros(9, bool), lost_joints=np.zeros(3, bool))
    assert Recognizer(loaded).recognise(masked) == Recognizer(loaded).recognise(frame)


def test_a_frame_of_another_glove_is_refused(loaded: Build) -> None:
    with pytest.raises(FrameError):
        Recognizer(loaded).recognise(Frame(0, np.zeros(3, bool), np.zeros(3, np.uint16)))


def test_a_tie_goes_to_the_grasp_named_first(make_tables: MakeTables, describe: Describe) -> None:
    tables = make_tables(switches=0, joints=0)
    tied = replace(tables, bias=np.array([1, 7, 2, 7, 0], np.int16))
    found = Recognizer(Build(describe(tied), tied)).recognise(Frame(0, np.zeros(0, bool), np.zeros(0, np.uint16)))
    assert (found.grasp, found.margin) == ("grasp 1", 0)
