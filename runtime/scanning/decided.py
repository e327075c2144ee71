"""When a scan may stop: as soon as no state of the unread switches could change the winner. Integer tables, exact.

Among sums that leave the unread switches out, let l be the leader. Class r can still overtake l if its score plus the
most that the unread switches can bring it closer (`Scorer.reach`) exceeds l's; or equals it, if r has the lower number
and would win the tie. `EarlyExit` stops when no r can, and no later: while it goes on, some state of the unread
switches makes another class win. `Decided` counts the same over recorded frames.
"""

from collections.abc import Sequence
from functools import lru_cache
from operator import add

import numpy as np
from numpy.typing import NDArray

from thenar.drivers.errors import SettingError

from ..errors import FrameError
from ..frames import Mask
from ..scores import LiveScores, Scorer, joint_reaches, reaches
from ..tables import IntegerTables

_KEPT = 1 << 16


class EarlyExit:
    """Watches a scan port by port.

    groups are the switches of each port, in reading order; no switch may be in two of them. With a `lead` in steps, the
    scan goes on until the leader is certain to lead all others by that much: a decision that requires such a lead
    (`Policy.lead`) is then the same as after the whole scan. `on_demand`: the joints are read after the switches, and
    only if these do not decide; until then nothing is known of them. `whole_us`: after this time without one, a scan
    goes to its end even if it is decided, for readers that need all scores; None: there are none.

    left_out  switches and joints that are scored as lost, though they are read
    """

    def __init__(
        self,
        scorer: Scorer,
        groups: Sequence[Mask],
        *,
        lead: int = 0,
        on_demand: bool = False,
        whole_us: int | None = None,
    ) -> None:
        """Raise SettingError if a switch is in two groups, or not in the build."""
        tables = scorer.tables
        self._groups = tuple(groups)
        self._later = _later(self._groups, tables.n_switches)
        self._lead, self.on_demand, self.whole_us = lead, on_demand, whole_us
        if on_demand:
            self._later = [later | scorer.joints_bit for later in self._later]
        self.left_out: tuple[Mask, Mask] = 0, 0
        self._all: Mask = (1 << tables.n_switches) - 1
        self._scores = LiveScores(scorer)
        self._reach = scorer.reach
        self._hurdles = lru_cache(maxsize=_KEPT // tables.n_classes)(self._hurdles_of)
        self._elsewhere: Mask = ~sum(self._groups) & ((1 << tables.n_switches) - 1)
        self._closed: Mask = 0
        self._lost: Mask = 0

    def start(self, codes: Sequence[int] | None, closed: Mask = 0, lost: Mask | None = None) -> None:
        """Begin a scan: the joints' codes (None: lost; on demand: ignored), and the known switches that are on no port.

        With lost=None all of those are lost. Raises FrameError.
        """
        out, joints = self.left_out
        self._closed = closed & self._elsewhere
        self._lost = (self._elsewhere if lost is None else lost & self._elsewhere) | out
        self._scores.joints(None if self.on_demand else codes, joints)

    def after(self, port: int, closed: Mask, lost: Mask = 0) -> bool:
        """Take the reading of port number `port`, its switches only; return whether later ports can be left out.

        Ports come in order. After the last, with no `lead`, the result is always True, if the joints are known.
        """
        group = self._groups[port]
        self._closed |= closed & group
        self._lost |= lost & group
        lanes = self._scores.lanes(self._closed, self._lost)
        best = max(lanes)
        nearest: int = max(map(add, lanes, self._hurdles(port, lanes.index(best))))
        return nearest <= best

    def unread(self, port: int) -> Mask:
        """Return the switches of the ports after number `port`."""
        return self._later[port] & self._all

    def _hurdles_of(self, port: int, leader: int) -> tuple[int, ...]:
        """Return the amounts which, added to a class's score, must not exceed the leader's: (K,), 0 for the leader."""
        found = [
            reach + max(self._lead, other < leader)
            for other, reach in enumerate(self._reach(leader, self._later[port]))
        ]
        found[leader] = 0
        return tuple(found)


def _later(groups: Sequence[Mask], n_switches: int) -> list[Mask]:
    """Return, for every group, the switches of the groups after it."""
    later, seen = [], 0
    for group in reversed(groups):
        later.append(seen)
        if group & seen or group >> n_switches:
            raise SettingError("a switch of the scan is read by two ports, or is not in the build: compile it again")
        seen |= group
    return later[::-1]


Ints = NDArray[np.int32]


class Decided:
    """Recorded frames under a set of ports, which is an integer: bit p is port p.

    on_demand: the joints are not known from the start. They are one more port, after the last.
    """

    def __init__(
        self,
        tables: IntegerTables,
        ports: Sequence[Sequence[int]],
        bits: NDArray[np.bool_],
        codes: NDArray[np.uint16],
        *,
        on_demand: bool = False,
    ) -> None:
        """Take the build's switches on each port, and the frames: bits (n, s) and codes (n, j).

        Switches on no port are known from the start. Raises FrameError if a shape does not fit the tables.
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
        joints = tables.joint_sums(codes)
        self._base = joints + bits[:, known].astype(np.int32) @ rows[known]
        self._shares = [bits[:, list(port)].astype(np.int32) @ rows[list(port)] for port in ports]
        self._reaches = [_reaches(tables, port) for port in ports]
        if on_demand:
            # As if the joints were lost; reading them adds the rest.
            share = joints - tables.jointless.astype(np.int32)
            self._base -= share
            self._shares.append(share)
            every = range(tables.n_classes)
            self._reaches.append(np.array([joint_reaches(tables, leader) for leader in every], np.int32))
        self._counts: dict[int, int] = {}

    def __len__(self) -> int:
        return self._frames

    def undecided(self, read: int) -> int:
        """Return the number of frames that are undecided after reading these ports."""
        if read not in self._counts:
            self._counts[read] = self._frames - int(np.count_nonzero(self.after(read)[1]))
        return self._counts[read]

    def after(self, read: int) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
        """Return each frame's leader after reading these ports (n,), and whether it is decided (n,)."""
        sums, classes = self._base.copy(), np.arange(self._base.shape[1])
        # hurdles[l, c]: how much closer c can come to leader l, plus one step if it would win a tie.
        hurdles = (classes < classes[:, np.newaxis]).astype(np.int32)
        for port, (share, reach) in enumerate(zip(self._shares, self._reaches, strict=True)):
            if read >> port & 1:
                sums += share
            else:
                hurdles += reach
        leaders = sums.argmax(axis=1)
        return leaders, (sums + hurdles[leaders]).max(axis=1) <= sums.max(axis=1)


def reach_of(tables: IntegerTables, switches: Sequence[int]) -> int:
    """Return the most steps by which these switches can bring any class closer to any other."""
    return int(_reaches(tables, switches).max())


def _reaches(tables: IntegerTables, switches: Sequence[int]) -> Ints:
    """Return the most steps by which class c can come closer to class l, at [l, c]; (K, K)."""
    return np.array([reaches(tables, leader, switches) for leader in range(tables.n_classes)], np.int32)
