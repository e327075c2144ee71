"""Hands closing on objects, at rest: forces and moments in balance, by Newton's method, many repetitions at a time.

Unknown are 20 joint angles and the object's 6 degrees of freedom. Every joint is a spring about its commanded angle,
with the torque that presses the pads (grip.py). Skin is a set of spheres, each a spring where it sinks into the object,
with friction that sticks: a second spring, sideways, from the point of skin to the point of the object that first
touched; it is let go beyond the Coulomb limit (settle.py says when, and how far beyond it skin may be at rest). The
object bears its weight and what the skin does to it; a soft spring to where it was put keeps what nothing else holds,
and whatever that spring carries is reported as the residual.

Each digit meets the others only through the object, so the Newton system is eliminated digit by digit (4 x 4), then the
object (6 x 6). All sums run in one fixed order: a repetition comes out the same in any company, on any machine.

    case.py       what one hand is told to do with one object, and where its skin first touches
    surface.py    distance and normal of many objects of several shapes at once
    balance.py    all forces at one guess, and how far they are from balance
    newton.py     how they change, and the Newton step
    pace.py       what counts as rest, and how much of a step is taken at once
    settle.py     steps until every repetition is at rest

Arrays: 5 digits, 7 spheres of skin a digit, 15 of the palm, 50 in all, n repetitions last.
"""

from .case import Case, Skin
from .pace import USUAL, Pace
from .settle import Rest, close

__all__ = ["USUAL", "Case", "Pace", "Rest", "Skin", "close"]
