from collections.abc import Callable

import numpy as np

from thenar.simulator.contact.model import Contact
from thenar.simulator.pipeline.batch import SLID_OUT_MM, Batch


def test_an_object_that_slid_out_of_the_hand_has_not_settled(make_batch: Callable[..., Batch]) -> None:
    batch = make_batch(range(3))
    batch.posture_deg, batch.pose = np.zeros((3, 20)), np.ones((3, 6))
    pose = batch.pose.copy()
    pose[:, 1] += [0.0, SLID_OUT_MM - 0.1, SLID_OUT_MM + 0.1]
    none = np.zeros(3)
    forces = np.zeros((3, 160))
    batch.take(Contact(batch.posture_deg, pose, forces, np.zeros((3, 20)), none, none == 0.0, none, none, 3))
    assert batch.settled.tolist() == [True, True, False]
