import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.runtime import Build, FrameError, Recognizer
from thenar.runtime.recognizer import Frame


@pytest.fixture(scope="module")
def loaded(make_tables, describe) -> Build:
    tables = make_tables()
    return Build(describe(tables), tables)


def _frame(seed: int) -> Frame:
    random = np.random.default_rng(seed)
    return Frame(seed, random.random(9) < 0.5, random.integers(0, 256, 3).astype(np.uint16))


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
    lost = {"lost_switches": np.ones(9, bool), "lost_joints": np.ones(3, bool)}
    other = replace(_frame(3), time_us=2, **lost)
    assert recognizer.recognise(replace(frame, **lost)) == recognizer.recognise(other)


def test_masks_that_mark_nothing_change_nothing(loaded: Build) -> None:
    frame = _frame(4)
    masked = replace(frame, lost_switches=np.zeros(9, bool), lost_joints=np.zeros(3, bool))
    assert Recognizer(loaded).recognise(masked) == Recognizer(loaded).recognise(frame)


def test_a_frame_of_another_glove_is_refused(loaded: Build) -> None:
    with pytest.raises(FrameError):
        Recognizer(loaded).recognise(Frame(0, np.zeros(3, bool), np.zeros(3, np.uint16)))
