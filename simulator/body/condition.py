"""A condition: one subject's hand, one grasp type, one object, and how that hand holds it when nothing disturbs."""

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
    """What presses on the object: a sphere of skin, and its force over the grip force."""

    sphere: int
    share: float


@dataclass(frozen=True, slots=True, eq=False)
class Held:
    """How a hand of some size holds an object when nothing disturbs.

    posture_deg  (20,) joint angles, order of DOF
    pose         (6,) the object in hand axes: position in mm, rotation vector in radians
    pads         what presses, with `grip_n` in all
    down         (3,) which way its weight pulls, a unit vector in hand axes
    """

    posture_deg: Floats
    pose: Floats
    pads: tuple[Pad, ...]
    grip_n: float
    down: Floats = field(default_factory=lambda: np.array([0.0, -1.0, 0.0]))


@dataclass(frozen=True, slots=True, eq=False)
class Condition:
    """What the repetitions of one batch share."""

    subject: str
    hand: Hand
    grasp: str
    thing: Thing
    held: Held

    def site(self, repetitions: NDArray[np.int64]) -> Site:
        """Return whose draws some repetitions (n,) draw."""
        return Site(self.subject, self.grasp, self.thing.name, repetitions)
