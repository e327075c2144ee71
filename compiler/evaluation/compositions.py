"""The paper's seven compositions of inputs, and which columns each takes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..recordings.graspset import GraspSet

Columns = tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Composition:
    """Which inputs a classifier gets: the joints (Angle), the placement's switches (Sel-Co), the others (NoSel-Co)."""

    name: str
    what: str
    angle: bool
    selected: bool
    others: bool

    @property
    def needs_placement(self) -> bool:
        """Whether its columns depend on which switches were selected."""
        return self.selected != self.others

    @property
    def has_switches(self) -> bool:
        """Whether it takes any switches."""
        return self.selected or self.others

    def columns(self, placement: Columns, n_switches: int, n_joints: int) -> Columns:
        """Return the ascending columns of `inputs` that it takes, given the selected switches."""
        kept = set(placement)
        switches = (s for s in range(n_switches) if (self.selected if s in kept else self.others))
        return (*switches, *range(n_switches, n_switches + n_joints * self.angle))


COMPOSITIONS = (
    Composition("I", "Angle + All-Co", angle=True, selected=True, others=True),
    Composition("II", "Angle + Sel-Co", angle=True, selected=True, others=False),
    Composition("III", "Angle + NoSel-Co", angle=True, selected=False, others=True),
    Composition("IV", "Angle", angle=True, selected=False, others=False),
    Composition("V", "All-Co", angle=False, selected=True, others=True),
    Composition("VI", "Sel-Co", angle=False, selected=True, others=False),
    Composition("VII", "NoSel-Co", angle=False, selected=False, others=True),
)
ANGLE_SELECTED, ANGLE, ALL_SWITCHES, SELECTED = COMPOSITIONS[1], COMPOSITIONS[3], COMPOSITIONS[4], COMPOSITIONS[5]


def available(n_switches: int, n_joints: int) -> tuple[Composition, ...]:
    """Return the compositions that a set has the inputs for: without switches only IV, without joints V, VI and VII."""
    return tuple(c for c in COMPOSITIONS if (n_joints or not c.angle) and (n_switches or not c.has_switches))


def inputs(grasp_set: GraspSet) -> NDArray[np.uint16]:
    """Return what compositions take columns of: (n, s + j), the switches' bits, then the joints' codes."""
    return np.hstack([grasp_set.switches.astype(np.uint16), grasp_set.codes])
