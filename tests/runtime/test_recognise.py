"""What a build recognises in one frame."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.runtime import Build

from ..tables import describe
from .conftest import make_tables

Frame = tuple[np.ndarray, np.ndarray]


@pytest.fixture(scope="module")
def loaded() -> Build:
    tables = make_tables()
    return Build(describe(tables), tables)


def _frame(seed: int) -> Frame:
    random = np.random.default_rng(seed)
    return random.random(9) < 0.5, random.integers(0, 256, 3).astype(np.uint16)


@given(seed=st.integers(0, 10_000))
def test_a_recognition_says_what_the_scores_say(loaded: Build, seed: int) -> None:
    frame = _frame(seed)
    scores = loaded.scores(*frame)
    found = loaded.recognise(*frame)
    assert found.grasp == loaded.classify(*frame)
    assert found.margin == np.diff(np.sort(scores)[-2:])[0]
    softmax = np.exp(scores / 100.0) / np.exp(scores / 100.0).sum()
    assert math.isclose(found.probability, softmax.max(), rel_tol=1e-9)
    assert not found.degraded


def test_a_lost_input_takes_its_mean_and_degrades_the_frame(loaded: Build) -> None:
    frame, lost = _frame(1), np.arange(9) == 4
    found = loaded.recognise(*frame, lost_switches=lost)
    lanes = loaded.scorer.biased_scores(*frame, lost, np.zeros(3, bool))
    assert found.degraded
    assert found.grasp == loaded.grasps[int(np.argmax(lanes))]
    assert found.margin == np.diff(np.sort(lanes)[-2:])[0]
