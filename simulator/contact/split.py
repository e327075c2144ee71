"""How the force on a segment is shared among its switches: a Winkler foundation, where the skin sinks in.

A contact solver gives one net force a capsule, whatever its kind; the switches of that capsule share it by their depth
in the object, since all stand for the same area of skin. Nothing is lost: what reaches no switch fell between them, and
is returned as such.
"""

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import add_up

from ..body.hand import CAPSULES
from ..body.layout import Switches

Floats = NDArray[np.float64]


def split(switches: Switches, depths: Floats, forces: Floats) -> tuple[Floats, Floats]:
    """Return the force on every switch (s, n), and what fell between them (n,), in newtons.

    depths (s, n): how deep each contact's top lies in the object, mm, negative outside; forces (20, n): net normal
    force on each capsule. Their sums agree to rounding.
    """
    sunk = np.maximum(depths, 0.0)
    shared, between = np.zeros_like(sunk), np.zeros(forces.shape[1])
    for capsule in range(len(CAPSULES)):
        own = np.flatnonzero(switches.capsules == capsule)
        total = add_up(sunk[own])
        touched = total > 0.0
        # Depth over depth first: force over a hair of depth would overflow.
        shared[own] = sunk[own] / np.where(touched, total, 1.0) * forces[capsule]
        between += np.where(touched, 0.0, forces[capsule])
    return shared, between
