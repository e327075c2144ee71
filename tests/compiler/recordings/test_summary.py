from dataclasses import replace

import hypothesis.strategies as st
import numpy as np
from hypothesis import given, settings

from thenar.compiler.recordings.graspset import GraspSet, Joint
from thenar.compiler.recordings.summary import JointRange, contacts, summarise


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


@given(data=st.data())
@settings(deadline=None)
def test_counts_add_up_for_any_set(data: st.DataObject, grasp_sets: st.SearchStrategy[GraspSet]) -> None:
    grasp_set = data.draw(grasp_sets)
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
