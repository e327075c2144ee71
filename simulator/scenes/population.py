"""Subjects drawn from surveys of hands.

Every subject has draws of their own, so that raising the count leaves the first ones as they were.
"""

from dataclasses import dataclass
from math import floor, sqrt
from typing import Annotated, Literal

import msgspec
import numpy as np

from ..streams import Draw, Draws, Site
from .scene import HAND_BREADTHS_MM, HAND_LENGTHS_MM, Subject

SITE = "population"
# Between length and breadth of a hand: AIST 1991-92.
CORRELATION = 0.79


@dataclass(frozen=True, slots=True)
class Spread:
    """A measure of many hands in mm: its mean and standard deviation."""

    mean: float
    sd: float

    def at(self, normal: float, limits: tuple[float, float]) -> float:
        """Return the hand that is `normal` deviations from the mean, inside `limits`, to a tenth of a millimetre."""
        return min(max(round(self.mean + self.sd * normal, 1), limits[0]), limits[1])


@dataclass(frozen=True, slots=True)
class Hands:
    """The hands of one sex in a survey."""

    length: Spread
    breadth: Spread


# Men, then women. Published: lengths of the US Army (ANSUR II, NATICK/TR-15/007), lengths from the radial styloid (some
# 6 mm more than from the wrist crease) and mean breadths of Japan (AIST 2012). Ours: ANSUR's mean breadths, 0.455 of
# the mean lengths, and the spread of all breadths.
_BREADTH_SD = 4.0
SURVEYS = {
    "ansur2": (
        Hands(Spread(193.3, 9.9), Spread(0.455 * 193.3, _BREADTH_SD)),
        Hands(Spread(181.1, 10.1), Spread(0.455 * 181.1, _BREADTH_SD)),
    ),
    "aist2012": (
        Hands(Spread(189.6, 8.1), Spread(83.3, _BREADTH_SD)),
        Hands(Spread(175.4, 7.3), Spread(74.4, _BREADTH_SD)),
    ),
}


class Population(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """So many subjects of a survey, men and women mixed evenly to the share of women."""

    survey: Literal["ansur2", "aist2012"]
    count: Annotated[int, msgspec.Meta(ge=1, le=10_000)]
    women: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 0.5


def draw_subjects(population: Population, seed: int) -> tuple[Subject, ...]:
    """Return the subjects P001, P002, ... of a population."""
    return tuple(_subject(population, seed, number) for number in range(population.count))


def _subject(population: Population, seed: int, number: int) -> Subject:
    name = f"P{number + 1:03d}"
    site = Site(name, "", "", np.zeros(1, dtype=np.int64))
    first, second = Draw(seed, SITE, site, Draws()).per_subject(2).normal().tolist()
    woman = floor((number + 1) * population.women) > floor(number * population.women)
    hands = SURVEYS[population.survey][woman]
    across = CORRELATION * first + sqrt(1.0 - CORRELATION * CORRELATION) * second
    return Subject(
        name=name,
        hand_length_mm=hands.length.at(first, HAND_LENGTHS_MM),
        hand_breadth_mm=hands.breadth.at(across, HAND_BREADTHS_MM),
    )
