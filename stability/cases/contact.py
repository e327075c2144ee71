"""Hands and objects that are hard to bring to rest: singular, coincident, weightless, huge; and halved steps.

Mass is only a weight: a massless object is one without weight, held by skin and its soft spring.
"""

from collections.abc import Iterator
from itertools import chain

from ..contact import halving, rest, surfaces
from ..finding import Case, Finding

CASE = Case(
    title="Contact in the simulator",
    danger="no weight, no contact or all contact at one point: NaN forces, or an unsettled grasp reported as settled",
)


def findings(full: bool) -> Iterator[Finding]:
    """Yield errors of surfaces and rotations, of rest, and of halved steps."""
    return chain.from_iterable(part.findings(full) for part in (surfaces, rest, halving))
