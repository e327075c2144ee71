"""How often a scan would be decided after some of its ports, over recorded frames: integer tables, exact.

A frame is decided when its leader can be overtaken by no state of the unread switches, as `earlyexit.py` defines it: an
unread switch adds nothing, its row or its mean row, and a tie goes to the class of the lowest number.
"""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import FrameError
from ..tables import IntegerTables

Ints = NDArray[np.int32]


class Decided:
    """Recorded frames under a set of ports. A set of ports is an integer: bit p is port p."""

    def __init__(
        self,
        tables: IntegerTables,
        ports: Sequence[Sequence[int]],
        bits: NDArray[np.bool_],
        codes: NDArray[np.uint16],
    ) -> None:
        """Take the build's switches on each port, and the frames: bits (n, s) and codes (n, j).

        Switches of no port are known from the start. Raises FrameError if a shape does not fit the tables.
        """
        if bits.shape != (len(bits), tables.n_switches) or codes.shape != (len(bits), tables.n_joints):
            raise FrameError(
                f"frames of shapes {bits.shape} and {codes.shape}, the build has {tables.n_switches} switches "
                f"and {tables.n_joints} joints"
            )
        rows = tables.switch_rows.astype(np.int32)
        known = sorted(set(range(tables.n_switches)).difference(*ports))
        self._frames = len(bits)
        # No partial sum leaves int16 (IntegerTables), so nothing overflows here.
        self._base = _joints(tables, codes) + bits[:, known].astype(np.int32) @ rows[known]
        self._shares = [bits[:, list(port)].astype(np.int32) @ rows[list(port)] for port in ports]
        self._reaches = [_reach(tables, list(port)) for port in ports]
        self._counts: dict[int, int] = {}

    def __len__(self) -> int:
        return self._frames

    def undecided(self, read: int) -> int:
        """Return how many frames are undecided when these ports were read."""
        if read not in self._counts:
            self._counts[read] = self._frames - int(np.count_nonzero(self.after(read)[1]))
        return self._counts[read]

    def after(self, read: int) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
        """Return each frame's leader when these ports were read (n,), and whether it is decided (n,)."""
        sums, classes = self._base.copy(), np.arange(self._base.shape[1])
        # hurdles[l, c]: what c can come closer to leader l, and one step where it would win a tie.
        hurdles = (classes < classes[:, np.newaxis]).astype(np.int32)
        for port, (share, reach) in enumerate(zip(self._shares, self._reaches, strict=True)):
            if read >> port & 1:
                sums += share
            else:
                hurdles += reach
        leaders = sums.argmax(axis=1)
        return leaders, (sums + hurdles[leaders]).max(axis=1) <= sums.max(axis=1)


def reach_of(tables: IntegerTables, switches: Iterable[int]) -> int:
    """Return the most steps by which these switches can bring any class closer to any other."""
    return int(_reach(tables, list(switches)).max())


def _reach(tables: IntegerTables, switches: list[int]) -> Ints:
    """Return the most steps by which class c can come closer to class l, at [l, c]; (K, K)."""
    found = np.zeros((tables.n_classes, tables.n_classes), np.int32)
    for switch in switches:
        row, mean = (rows[switch].astype(np.int32) for rows in (tables.switch_rows, tables.switch_means))
        found += np.maximum(0, np.maximum(row - row[:, np.newaxis], mean - mean[:, np.newaxis]))
    return found


def _joints(tables: IntegerTables, codes: NDArray[np.uint16]) -> Ints:
    """Return the bias and what the joints add, (n, K)."""
    sums = np.repeat(tables.bias[np.newaxis].astype(np.int32), len(codes), axis=0)
    for column, (thresholds, rows) in enumerate(zip(tables.thresholds, tables.joint_rows, strict=True)):
        sums += rows[np.searchsorted(thresholds, codes[:, column], side="left")]
    return sums
