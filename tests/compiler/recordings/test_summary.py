from dataclasses import replace
from itertools import product

import hypothesis.strategies as st
import numpy as np
from hypothesis import given

from thenar.compiler.recordings.graspset import GraspSet, Joint
from thenar.compiler.recordings.summary import (
    JointRange,
    constant_columns,
    contacts,
    disagreeing,
    duplicate_columns,
    find_oddities,
    frame_numbers,
    summarise,
)
from thenar.compiler.recordings.taxonomy import own

from .conftest import grasp_sets


def test_a_set_is_counted(small: GraspSet) -> None:
    summary = summarise(small)
    assert (summary.frames, summary.taxonomy, summary.fingerprint) == (6, "kamakura14", small.fingerprint())
    assert summary.grasps == {"PoS": 2, "PoH": 2, "Tip": 2}
    assert len(summary.absent) == 11
    assert summary.balance == 1.0
    assert summary.subjects == {"A": 4, "B": 2}
    assert summary.objects == {"mug": 6}
    assert summary.switches == {"dead": 0.0, "thumb": 0.5, "palm": 0.5, "palm copy": 0.5}
    assert summary.joints == (JointRange("index", "deg", -9.5, -8.0, 4), JointRange("wrist", "deg", 3.5, 3.5, 1))
    assert {finding.kind for finding in summary.warnings} >= {"constant switches", "contradictory frames"}
    assert summary.warnings[-2].rows == (2, 3)


@given(grasp_set=grasp_sets())
def test_counts_add_up_for_any_set(grasp_set: GraspSet) -> None:
    summary = summarise(grasp_set)
    for counts in (summary.grasps | {"nothing": summary.none}, summary.subjects, summary.objects):
        assert sum(counts.values()) == len(grasp_set)
    assert len(summary.grasps) + len(summary.absent) == len(grasp_set.taxonomy.types)
    assert (summary.balance > 0) == (summary.none < len(grasp_set))
    assert (summary.seconds is None) == (not grasp_set.times_us.size)
    assert summary.movements == len(np.unique(grasp_set.movement_ids))
    for joint, told, codes in zip(grasp_set.joints, summary.joints, grasp_set.codes.T, strict=True):
        assert told.codes == len(np.unique(codes))
        assert (told.least, told.largest) == (joint.value(codes).min(), joint.value(codes).max())


def test_rows_in_which_nothing_is_held_count_apart_and_clash_with_none(small: GraspSet) -> None:
    nothing = np.array([False, True, True, False, False, True])
    found = replace(small, grasps=np.where(nothing, "none", small.grasps), times_us=10_000 * np.arange(6))
    summary = summarise(found)
    assert (summary.frames, summary.none, summary.movements, summary.seconds) == (6, 3, 6, 0.03)
    assert summary.grasps == {"PoS": 2, "Tip": 1}
    assert (summary.balance, len(summary.absent)) == (0.5, 12)
    kinds = {finding.kind: finding for finding in summary.warnings}
    assert "contradictory frames" not in kinds
    assert kinds["frames shared by subjects"].rows == (1, 4)
    assert kinds["grasp types that a subject lacks"].message == "subject A has no Tip"


def test_a_set_without_rows_has_a_summary(small: GraspSet) -> None:
    summary = summarise(small.rows([]))
    assert (summary.frames, summary.grasps, summary.balance) == (0, {}, 0.0)
    assert {(joint.least, joint.largest, joint.codes) for joint in summary.joints} == {(None, None, 0)}


def test_taxels_have_ranges_and_are_touched_above_their_noise(small: GraspSet) -> None:
    pads = np.array([[0, 2], [900, 0], [12, 3], [1000, 1], [3, 0], [880, 2]], np.uint16)
    columns = tuple(Joint(name, "N", 0, 0.0, 1000, 1.0) for name in ("pad", "idle"))
    with_pads = replace(small, taxels=pads, taxel_columns=columns)
    summary = summarise(with_pads)
    assert summary.taxels == (JointRange("pad", "N", 0.0, 1.0, 6), JointRange("idle", "N", 0.0, 0.003, 4))
    touched = contacts(with_pads)
    assert (touched[:, : len(small.switch_names)] == small.switches).all()
    assert touched[:, -2:].tolist() == [[False, False], [True, False]] * 3


def test_every_oddity_is_counted_and_named(small: GraspSet) -> None:
    found = {finding.kind: finding for finding in find_oddities(small, np.arange(10, 10 + len(small)))}
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
def test_frames_have_one_number_exactly_where_they_are_equal(data: st.DataObject) -> None:
    drawn = data.draw(grasp_sets())
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
