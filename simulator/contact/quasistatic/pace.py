"""How rest is looked for: what counts as rest, and how much of a Newton step is taken at once."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Pace:
    """What the numbers that come out should hardly depend on: halved, it tells how much they do.

    rest_n, rest_nmm  what may be left out of balance, on the object and on each joint
    parts             how many parts every Newton step is taken in, each found anew; all counts of steps grow as much
    """

    rest_n: float = 0.05
    rest_nmm: float = 3.0
    parts: int = 1


USUAL = Pace()
