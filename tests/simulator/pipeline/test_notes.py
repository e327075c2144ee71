import numpy as np

from thenar.simulator.contact.model import Contact
from thenar.simulator.pipeline.batch import SLID_OUT_MM, Batch
from thenar.simulator.pipeline.report import UnsettledGrasp, notes_of

from ..small import make_batch


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
