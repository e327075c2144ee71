from dataclasses import replace
from itertools import product

import hypothesis.strategies as st
import numpy as np
from hypothesis import given, settings

from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.recordings.summary import (
    Oddity,
    constant_columns,
    disagreeing,
    duplicate_columns,
    find_oddities,
    frame_numbers,
)
from thenar.compiler.recordings.taxonomy import own


def by_kind(grasp_set: GraspSet) -> dict[str, Oddity]:
    return {finding.kind: finding for finding in find_oddities(grasp_set, np.arange(10, 10 + len(grasp_set)))}


def test_every_oddity_is_counted_and_named(small: GraspSet) -> None:
    found = by_kind(small)
    assert found["constant switches"].columns == ("dead",)
    assert found["constant joints"].columns == ("wrist",)
    assert found["duplicate switches"].columns == ("palm copy",)
    assert "palm copy = palm" in found["duplicate switches"].message
    assert found["frames shared by subjects"].rows == (10, 13)
    assert found["frames shared by subjects"].count == 2
    assert found["contradictory frames"].rows == (11, 12)
    assert found["grasp types that a subject lacks"].message == "subject B has no PoH"
    assert len(found) == 6


@given(data=st.data())
@settings(deadline=None)
def test_frames_have_one_number_exactly_where_they_are_equal(
    data: st.DataObject, grasp_sets: st.SearchStrategy[GraspSet]
) -> None:
    drawn = data.draw(grasp_sets)
    grasp_set = drawn.rows(data.draw(st.lists(st.integers(0, len(drawn) - 1), min_size=1, max_size=8)))
    numbers = frame_numbers(grasp_set)
    inputs = np.hstack([grasp_set.switches, grasp_set.codes, grasp_set.taxels])
    frames = [tuple(row) for row in inputs.tolist()]
    for (one, frame), (other, other_frame) in product(zip(numbers, frames, strict=True), repeat=2):
        assert (one == other) == (frame == other_frame)


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 2)), min_size=1))
def test_rows_disagree_where_their_frame_has_another_value_elsewhere(pairs: list[tuple[int, int]]) -> None:
    frames, what = np.array(pairs).T
    frames = np.unique(frames, return_inverse=True)[1]
    expected = [
        any(f == g and v != w for g, w in zip(frames, what, strict=True)) for f, v in zip(frames, what, strict=True)
    ]
    assert disagreeing(frames, what).tolist() == expected


@given(st.lists(st.lists(st.integers(0, 1), min_size=4, max_size=4), min_size=1, max_size=5))
def test_constant_and_duplicate_columns_are_all_found(rows: list[list[int]]) -> None:
    columns = list(zip(*rows, strict=True))
    constant = [name for name, column in zip("abcd", columns, strict=True) if len(set(column)) == 1]
    assert list(constant_columns(np.array(rows), "abcd")) == constant
    repeats = [
        (name, "abcd"[columns.index(column)])
        for number, (name, column) in enumerate(zip("abcd", columns, strict=True))
        if columns.index(column) != number and name not in constant
    ]
    assert list(duplicate_columns(np.array(rows), "abcd")) == repeats


def test_what_ten_thousand_subjects_lack_is_counted_without_listing_it(small: GraspSet) -> None:
    """Of a grasp type a subject, 10^8 pairs but 10^4 are absent: listed, they took gigabytes."""
    names = np.array([f"{number:05}" for number in range(10_000)])
    grasp_set = replace(
        small.rows(np.zeros(10_000, np.intp)), grasps=names, taxonomy=own(names.tolist()), subjects=names
    )
    found = {finding.kind: finding for finding in find_oddities(grasp_set, np.arange(10_000))}
    lacking = found["grasp types that a subject lacks"]
    assert lacking.count == 10_000 * 9_999
    assert lacking.message.startswith("subject 00000 has no 00001, subject 00000 has no 00002")
    assert lacking.message.endswith(" and 99989995 more")
