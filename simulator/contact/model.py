"""What every contact model takes and gives."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..body.condition import Condition

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


class ContactModel(Protocol):
    """Closes hands on objects."""

    def solve(self, loads: Sequence[Load]) -> list[Contact]:
        """Return how the hands rest, a Contact a load. No repetition depends on which others are solved beside it."""
        ...
