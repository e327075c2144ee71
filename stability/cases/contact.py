"""Hands and objects that are hard to bring to rest: singular, coincident, weightless, huge; and steps halved.

What stands for mass where there is none: in contact.quasistatic mass is a weight and nothing else, so an object of none
is one without weight, held by skin and its soft spring. contact.mujoco moves in time, which needs inertia: any object
has that of 0.1 kg at least there, and its true weight pulls.
"""

from collections.abc import Iterator
from itertools import chain

from ..contact import halving, rest, surfaces, systems
from ..finding import Case, Finding

CASE = Case(
    title="Contact in the simulator",
    danger="no weight, no contact or all of it at one point: NaN for forces, or a grasp called settled that is not",
)


def findings(full: bool) -> Iterator[Finding]:
    """Yield errors of surfaces and turns, of the Newton system, of what is called rest, and of steps halved."""
    parts = (surfaces, systems, rest, halving)
    return chain.from_iterable(part.findings(full) for part in parts)
