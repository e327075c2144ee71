"""What a scanner board's driver tells: the keys at one time, what the board recognised, and what came in."""

from dataclasses import dataclass
from typing import NamedTuple

Mask = int


class ScannerReading(NamedTuple):
    """The keys at one time, in the host's monotonic microseconds.

    known holds the keys of which anything can be said: none from a lost frame until the board has told all of its keys
    again, none that the board says it cannot read, and of a matrix without diodes only those that cannot be ghosts.
    `closed` holds no others.
    """

    time_us: int
    closed: Mask
    known: Mask


class BoardGrasp(NamedTuple):
    """What a board recognised by itself, in a frame that it read at time_us, in the host's monotonic microseconds.

    number    of the grasp type in the order of the build that the board carries; None: none was recognised
    margin    the best score less the second, in steps of the build's tables; 65535 stands for more, too
    degraded  whether an input was missing
    early     whether the scan ended as soon as the rest of the switches could not matter
    """

    time_us: int
    number: int | None
    margin: int
    degraded: bool
    early: bool


@dataclass(frozen=True, slots=True)
class ScannerCounts:
    """What came in since the board was opened.

    Sound frames; damaged, too short and too long ones; gaps in the numbers of the sound ones; misfits, which were sound
    but said what this board cannot say. And how often the state was asked for, something being amiss, and the time.
    """

    frames: int
    damaged: int
    short: int
    overlong: int
    gaps: int
    misfits: int
    asked: int
    pings: int
