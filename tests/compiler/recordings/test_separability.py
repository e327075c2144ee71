from collections import Counter
from dataclasses import replace
from itertools import chain

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

from thenar.compiler.recordings.graspset import GraspSet, Joint
from thenar.compiler.recordings.summary import NEIGHBOUR_ROWS, separabilities
from thenar.compiler.recordings.taxonomy import own


def blobs(rows: int, gap: int) -> GraspSet:
    """Two grasp types, `gap` codes apart."""
    random = np.random.default_rng(3)
    labels = np.arange(rows) % 2
    return GraspSet(
        switches=(labels[:, None] == 1) ^ (random.random((rows, 1)) < 0.2),
        switch_names=("palm",),
        codes=(random.integers(0, 100, (rows, 2)) + labels[:, None] * gap).astype(np.uint16),
        joints=tuple(Joint(name, "deg", 0, 0.0, 1, 0.5) for name in ("index", "wrist")),
        grasps=np.array(["a", "b"])[labels],
        taxonomy=own(["a", "b"]),
        subjects=np.full(rows, "A"),
        objects=np.full(rows, "mug"),
        trials=np.arange(rows),
    )


@given(data=st.data())
@settings(deadline=None)
def test_the_ceiling_is_the_rate_of_the_best_memory(
    data: st.DataObject, grasp_sets: st.SearchStrategy[GraspSet]
) -> None:
    drawn = data.draw(grasp_sets)
    grasp_set = drawn.rows(data.draw(st.lists(st.integers(0, len(drawn) - 1), min_size=1, max_size=9)))
    found, grasp_set = separabilities(grasp_set), grasp_set.without_none()
    assert (found == ()) == (not len(grasp_set))
    for line in found:
        parts = {"switches": grasp_set.switches, "taxels": grasp_set.taxels, "joints": grasp_set.codes}
        read = [part.tolist() for name, part in parts.items() if line.inputs in (name, "both", "all")]
        memory: dict[tuple[int, ...], Counter[str]] = {}
        for *frame, grasp in zip(*read, grasp_set.grasps.tolist(), strict=True):
            memory.setdefault(tuple(chain.from_iterable(frame)), Counter())[grasp] += 1
        assert line.distinct_frames == len(memory)
        assert line.ceiling == sum(max(counts.values()) for counts in memory.values()) / len(grasp_set)


def test_types_that_lie_apart_are_told_apart_and_equal_ones_are_not() -> None:
    apart = {line.inputs: line.neighbour_rate for line in separabilities(blobs(200, 1000))}
    assert apart["joints"] == apart["both"] == 1.0
    mixed = {line.inputs: line.neighbour_rate for line in separabilities(blobs(200, 0))}
    assert mixed["joints"] == pytest.approx(0.5, abs=0.12)


def test_a_joint_that_moves_far_does_not_drown_one_that_tells() -> None:
    told = blobs(200, 200)
    codes = told.codes * np.array([1, 600]) % 60_000
    far = replace(told, codes=codes.astype(np.uint16))
    assert {line.inputs: line.neighbour_rate for line in separabilities(far)}["joints"] == 1.0


def test_the_neighbour_is_another_row() -> None:
    (line,) = [line for line in separabilities(blobs(2, 1)) if line.inputs == "joints"]
    assert line.neighbour_rate == 0.0


def test_a_large_set_is_sampled_and_says_so() -> None:
    lines = separabilities(blobs(NEIGHBOUR_ROWS + 1, 1000))
    assert {line.neighbour_rows for line in lines} == {NEIGHBOUR_ROWS}
    assert lines == separabilities(blobs(NEIGHBOUR_ROWS + 1, 1000))


@pytest.mark.parametrize("frames", [2, 7])
def test_the_neighbour_is_of_another_trial(frames: int) -> None:
    """A frame of the same trial would give away the grasp type of types that cannot be told apart."""
    rows = np.repeat(np.arange(60), frames)
    single, mixed = (
        {line.inputs: line.neighbour_rate for line in separabilities(each)}["joints"]
        for each in (blobs(60, 0), blobs(60, 0).rows(rows))
    )
    assert mixed == pytest.approx(single, abs=0.05)
    claimed = replace(blobs(60, 0).rows(rows), independent=True)
    assert {line.inputs: line.neighbour_rate for line in separabilities(claimed)}["joints"] == 1.0
    one = blobs(1, 0).rows([0] * frames)
    assert {line.neighbour_rate for line in separabilities(one)} == {None}
