"""The scores of a live frame, kept up by what changes: the same numbers as a frame added up whole."""

from bisect import bisect_left
from collections.abc import Sequence
from operator import getitem

from ..errors import FrameError
from ..packed import PackedTables
from ..tables import IntegerTables
from .frames import Mask

# Switches are looked up eight at a time: a byte of a mask is the place of its sum of rows.
_EIGHT = 8


class LiveScores:
    """Three sums of packed rows, each worked out anew when what it is of changes; at first every switch is open and
    every joint lost.

    A switch adds its row while it is closed, its mean row while it is lost; a joint adds the row of its code's bin, its
    mean row while it is lost. So `lanes` are exactly `Scorer.lanes_without` of the same state.
    """

    __slots__ = ("_closed", "_codes", "_joints", "_lost", "_means", "_packed", "_rows", "_silent", "_there", "_width")

    def __init__(self, tables: IntegerTables) -> None:
        self._packed = PackedTables(tables)
        self._rows, self._means = _sums(self._packed.switch_rows), _sums(self._packed.switch_means)
        self._width = tables.n_switches
        self._there: Mask = 0
        self._lost: Mask = 0
        self._closed, self._silent = self._packed.start, 0
        self._codes: tuple[int, ...] | None = None
        self._joints = sum(self._packed.joint_means)

    def switches(self, closed: Mask, lost: Mask = 0) -> None:
        """Take the state of all switches; bits of `closed` that are lost mean nothing. Raises FrameError."""
        if (closed | lost) >> self._width:
            raise FrameError(f"a switch beyond the {self._width} of the build is closed or lost")
        there = closed & ~lost
        if there != self._there:
            self._closed = self._packed.start + _sum(there, self._rows)
            self._there = there
        if lost != self._lost:
            self._silent = _sum(lost, self._means)
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
        return self._packed.unpacked(self._closed + self._silent + self._joints)


def _sums(rows: Sequence[int]) -> list[list[int]]:
    """Return, for every eight switches, the sums of the rows of all sets of them, by the byte that such a set is."""
    return [_sums_of(rows[first : first + _EIGHT]) for first in range(0, len(rows), _EIGHT)]


def _sums_of(rows: Sequence[int]) -> list[int]:
    sums = [0]
    for row in rows:
        sums += [row + others for others in sums]
    return sums


def _sum(switches: Mask, sums: Sequence[Sequence[int]]) -> int:
    """Return what the rows of `switches` add up to."""
    return sum(map(getitem, sums, switches.to_bytes(len(sums), "little")))
