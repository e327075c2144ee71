"""The scores of a live frame, kept up by what changes: the same numbers as a frame added up whole."""

from bisect import bisect_left
from collections.abc import Sequence
from operator import getitem

from ..errors import FrameError
from ..packed import PackedTables
from ..tables import IntegerTables
from .frames import Mask

# Switches are looked up four at a time: a scan changes many at once, and a table of 16 rows is small.
_FOUR = 4


class LiveScores:
    """A running sum of packed rows; at first every switch is open and every joint lost.

    A switch adds its row while it is closed, its mean row while it is lost; a joint adds the row of its code's bin, its
    mean row while it is lost. Sums of integers forget nothing, so however many changes went by, `lanes` are exactly
    `Scorer.lanes_without` of the state that they led to.
    """

    __slots__ = ("_codes", "_joints", "_lost", "_means", "_packed", "_rows", "_switches", "_there", "_width")

    def __init__(self, tables: IntegerTables) -> None:
        self._packed = PackedTables(tables)
        self._rows, self._means = _sums(self._packed.switch_rows), _sums(self._packed.switch_means)
        self._width = tables.n_switches
        self._there: Mask = 0
        self._lost: Mask = 0
        self._switches = self._packed.start
        self._codes: tuple[int, ...] | None = None
        self._joints = sum(self._packed.joint_means)

    def switches(self, closed: Mask, lost: Mask = 0) -> None:
        """Take the state of all switches; bits of `closed` that are lost mean nothing. Raises FrameError."""
        if (closed | lost) >> self._width:
            raise FrameError(f"a switch beyond the {self._width} of the build is closed or lost")
        there = closed & ~lost
        if there != self._there:
            self._switches += _change(self._there, there, self._rows)
            self._there = there
        if lost != self._lost:
            self._switches += _change(self._lost, lost, self._means)
            self._lost = lost

    def joints(self, codes: Sequence[int] | None) -> None:
        """Take the codes of all joints; None: all are lost. Raises FrameError."""
        taken = None if codes is None else tuple(codes)
        if taken == self._codes:
            return
        packed = self._packed
        if taken is None:
            self._joints = sum(packed.joint_means)
        elif len(taken) != len(packed.thresholds):
            raise FrameError(f"{len(taken)} codes, the build has {len(packed.thresholds)} joints")
        else:
            self._joints = sum(map(getitem, packed.joint_rows, map(bisect_left, packed.thresholds, taken)))
        self._codes = taken

    def lanes(self) -> tuple[int, ...]:
        """Return the K scores, each 2^15 too high."""
        return self._packed.unpacked(self._switches + self._joints)


def _sums(rows: Sequence[int]) -> list[list[int]]:
    """Return, for every four switches, the sum of the rows of each of the 16 sets of them."""
    fours = [rows[first : first + _FOUR] for first in range(0, len(rows), _FOUR)]
    return [[sum(row for bit, row in enumerate(four) if chosen >> bit & 1) for chosen in range(16)] for four in fours]


def _change(old: Mask, new: Mask, sums: Sequence[Sequence[int]]) -> int:
    """Return what the rows of the switches in `new` add up to beyond those in `old`."""
    total, changed = 0, old ^ new
    while changed:
        number = ((changed & -changed).bit_length() - 1) // _FOUR
        first, rows = number * _FOUR, sums[number]
        total += rows[new >> first & 15] - rows[old >> first & 15]
        changed &= -16 << first
    return total
