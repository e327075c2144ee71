"""A condition: one subject's hand, one grasp type, one object, and the undisturbed grasp."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import Floats

from ..streams import Site
from .hand import Hand
from .shapes import Shape


@dataclass(frozen=True, slots=True)
class Thing:
    """An object to hold."""

    name: str
    shape: Shape
    mass_kg: float


@dataclass(frozen=True, slots=True)
class Pad:
    """A sphere of skin that presses on the object, and its force over the grip force."""

    sphere: int
    share: float


@dataclass(frozen=True, slots=True, eq=False)
class PlannedGrasp:
    """The undisturbed grasp of an object by a hand of some size.

    posture_deg  (20,) joint angles, order of DOF
    pose         (6,) the object in hand axes: position in mm, rotation vector in radians
    pads         the pressing pads, with a total force of `grip_n`
    down         (3,) direction of its weight, a unit vector in hand axes
    """

    posture_deg: Floats
    pose: Floats
    pads: tuple[Pad, ...]
    grip_n: float
    down: Floats = field(default_factory=lambda: np.array([0.0, -1.0, 0.0]))


@dataclass(frozen=True, slots=True, eq=False)
class Condition:
    """The common properties of the repetitions of one batch."""

    subject: str
    hand: Hand
    grasp: str
    thing: Thing
    held: PlannedGrasp

    def site(self, repetitions: NDArray[np.int64]) -> Site:
        """Return the draw site of some repetitions (n,)."""
        return Site(self.subject, self.grasp, self.thing.name, repetitions)
