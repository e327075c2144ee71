from collections import Counter

import numpy as np
import pytest

from thenar.runtime.published import Count
from thenar.simulator.contact.model import Contact
from thenar.simulator.pipeline.batch import SLID_OUT_MM, Batch
from thenar.simulator.pipeline.report import (
    GraspReport,
    Notes,
    Rows,
    UnsettledGrasp,
    grasp_reports,
    notes_of,
    step_reports,
)
from thenar.simulator.pipeline.steps import Ledger

from ..small import make_batch

ONE = UnsettledGrasp("A", "Tip", "pin", 3, 17, "the hand did not come to rest")


def rows_with(closed: list[list[int]], read_out: list[bool] | None = None) -> Rows:
    """Return rows whose closed switches are given."""
    bits = np.zeros((len(closed), 160), dtype=bool)
    for row, switches in enumerate(closed):
        bits[row, switches] = True
    numbers = np.arange(len(closed), dtype=np.uint32)
    return Rows(
        bits=np.packbits(bits, axis=1),
        codes=np.zeros((len(closed), 16), dtype=np.uint16),
        taxels=np.zeros((len(closed), 0), dtype=np.uint16),
        condition=np.zeros(len(closed), dtype=np.uint32),
        trial=numbers,
        read_out=np.array(read_out or [True] * len(closed), dtype=bool),
        held=np.ones(len(closed), dtype=bool),
        time_us=np.zeros(len(closed), dtype=np.int64),
    )


def notes(grasp: str, repetitions: int, *unsettled: UnsettledGrasp, residual_n: float = 0.0) -> Notes:
    return Notes(grasp, repetitions, unsettled, residual_n, 10 * residual_n, 8 * residual_n, 0)


def test_switches_patterns_and_grasps_without_contact_are_counted_by_grasp_type() -> None:
    rows = rows_with([[1, 2, 3], [1, 2, 3], [], [159], [5, 6]])
    made = [notes("PoS", 4), notes("Tip", 2, ONE, residual_n=0.25), notes("Tip", 1, residual_n=0.125)]
    grasps = np.array([0, 0, 0, 1, 1])
    assert grasp_reports(rows, grasps, ("PoS", "Tip"), made) == (
        GraspReport("PoS", 4, 3, 0, 2.0, 0, 3, 2, 1, 0.0, 0.0, 0.0),
        GraspReport("Tip", 3, 2, 1, 1.5, 1, 2, 2, 0, 0.25, 2.5, 1.5),
    )


def test_only_rows_that_are_read_out_tell_of_switches() -> None:
    rows = rows_with([[], [], [4]], [False, False, True])
    (found,) = grasp_reports(rows, np.zeros(3, dtype=np.intp), ("PoS",), [notes("PoS", 1)])
    assert (found.rows, found.switches_mean, found.patterns, found.no_contact) == (3, 1.0, 1, 0)


def test_steps_are_reported_in_their_order_with_their_share_of_the_time() -> None:
    ledger = Ledger()
    ledger.enter("glove.recall", True, 1, 10, 1_000_000, Counter())
    for _ in range(2):
        drawn = Counter({"joint.noise": 40, "bytes sent": 3, "a": 1})
        ledger.enter("joint.noise", False, 1, 10, 1_500_000, drawn)
    recall, noise = step_reports(ledger)
    assert (recall.name, recall.own, recall.us_a_grasp, recall.share) == ("glove.recall", True, 100.0, 0.25)
    assert (noise.calls, noise.grasps, noise.draws, noise.own) == (2, 20, 80, False)
    assert (noise.seconds, noise.us_a_grasp, noise.share) == pytest.approx((0.003, 150.0, 0.75))
    assert noise.counts == (Count("a", 2), Count("bytes sent", 6))


def went_through(batch: Batch) -> Batch:
    """Return a batch whose second and fourth repetition did not settle."""
    batch.settled = np.array([True, False, True, False])
    batch.residual_n = np.array([0.5, 70.0, 0.25, 80.0])
    batch.residual_nmm = np.array([3.0, 700.0, 4.0, 1234.5])
    batch.between_n = np.array([0.5, 100.0, 0.25, 1000.0])
    batch.pose, batch.commanded_pose = np.zeros((4, 6)), np.zeros((4, 6))
    return batch


def test_what_did_not_settle_is_named_and_told_why() -> None:
    found = notes_of(went_through(make_batch([10, 11, 12, 13])))
    assert (found.grasp, found.repetitions, found.lost_frames) == ("PoS", 4, 0)
    reason = "the hand did not come to rest; residual on the object: 70 N, 700 N mm"
    assert found.unsettled[0] == UnsettledGrasp("A", "PoS", "bar", 11, 33, reason)
    assert [one.repetition for one in found.unsettled] == [11, 13]


def test_an_object_that_slid_out_of_the_hand_is_called_that() -> None:
    batch = went_through(make_batch())
    batch.pose[1] = [12.0, 16.0, 15.0, 0.0, 0.0, 0.0]
    assert notes_of(batch).unsettled[0].why == "the object slid 25 mm, out of the hand"


def test_residuals_are_those_of_settled_repetitions() -> None:
    batch = went_through(make_batch())
    batch.residual_n[1] = np.nan
    found = notes_of(batch)
    assert (found.residual_n, found.residual_nmm, found.between_n) == (0.5, 4.0, 0.75)
    assert "nan N" in found.unsettled[0].why


def test_missing_frames_and_empty_repetitions_are_reported() -> None:
    batch = went_through(make_batch())
    batch.lost = np.array([[True, False, True], [True, True, True], [False, False, True], [False, True, False]])
    found = notes_of(batch)
    assert found.lost_frames == 3
    assert found.unsettled[0].why == "no frame arrived whole"
    assert "come to rest" in found.unsettled[1].why


def test_an_object_that_slid_out_of_the_hand_has_not_settled() -> None:
    batch = make_batch(range(3))
    batch.posture_deg, batch.pose = np.zeros((3, 20)), np.ones((3, 6))
    pose = batch.pose.copy()
    pose[:, 1] += [0.0, SLID_OUT_MM - 0.1, SLID_OUT_MM + 0.1]
    none = np.zeros(3)
    forces = np.zeros((3, 160))
    batch.take(Contact(batch.posture_deg, pose, forces, np.zeros((3, 20)), none, none == 0.0, none, none, 3))
    assert batch.settled.tolist() == [True, True, False]
