"""What a scanner board's driver tells: the keys at one time, and what came in."""

from dataclasses import dataclass
from typing import NamedTuple

Mask = int


class ScannerReading(NamedTuple):
    """The keys at one time, in the host's monotonic microseconds.

    known holds the keys of which anything can be said: none from a lost frame to the next full bitmap, and of a matrix
    without diodes only those that cannot be ghosts. `closed` holds no others.
    """

    time_us: int
    closed: Mask
    known: Mask


@dataclass(frozen=True, slots=True)
class ScannerCounts:
    """What came in since the board was opened.

    Sound frames; damaged, too short and too long ones; gaps in the numbers of the sound ones; misfits, which were sound
    but said what this board cannot say. And how often the state and the time were asked for, something being amiss.
    """

    frames: int
    damaged: int
    short: int
    overlong: int
    gaps: int
    misfits: int
    asked: int
    pings: int
