"""What every contact model takes and gives."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..body.condition import Condition
from ..pipeline.batch import Batch

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Contact:
    """How n repetitions of a condition came to rest, s switches.

    posture_deg (n, 20), pose (n, 6)   as settled
    forces_n    (n, s)                 on the switches
    capsules_n  (n, 20)                net normal force on every capsule
    between_n   (n,)                   what fell between the switches
    settled     (n,)                   False where the model gave up or warned
    residual_n, residual_nmm (n,)      force and moment on the object that nothing balances
    steps                              of the solver, all repetitions together
    """

    posture_deg: Floats
    pose: Floats
    forces_n: Floats
    capsules_n: Floats
    between_n: Floats
    settled: NDArray[np.bool_]
    residual_n: Floats
    residual_nmm: Floats
    steps: int


@dataclass(frozen=True, slots=True, eq=False)
class Load:
    """What n hands of a condition are told: to take posture_deg (n, 20) round an object at pose (n, 6), mm and radians,
    and to press it with grip_n (n,) in all.
    """

    condition: Condition
    posture_deg: Floats
    pose: Floats
    grip_n: Floats


# An object that slid so far was dropped: ours.
SLID_OUT_MM = 20.0


class ContactModel(Protocol):
    """Closes hands on objects."""

    def solve(self, loads: Sequence[Load]) -> list[Contact]:
        """Return how the hands rest, a Contact a load. No repetition depends on which others are solved beside it."""
        ...


def load_of(batch: Batch) -> Load:
    """Return what a batch tells its hands."""
    return Load(batch.condition, batch.posture_deg, batch.pose, batch.grip_n)


def slid_mm(batch: Batch) -> Floats:
    """Return how far (n,) each object lies from where the hand was told to hold it."""
    x, y, z = (batch.pose[:, :3] - batch.commanded_pose[:, :3]).T
    distance: Floats = np.sqrt(x * x + y * y + z * z)
    return distance


def take(batch: Batch, contact: Contact) -> None:
    """Let the hands of a batch rest as solved. A grasp whose object slid out of the hand has not settled: what holds it
    then is no hand.
    """
    batch.commanded_deg, batch.commanded_pose = batch.posture_deg, batch.pose
    batch.posture_deg, batch.pose, batch.forces_n = contact.posture_deg, contact.pose, contact.forces_n
    batch.settled, batch.between_n = contact.settled & (slid_mm(batch) <= SLID_OUT_MM), contact.between_n
    batch.residual_n, batch.residual_nmm = contact.residual_n, contact.residual_nmm
