"""When a scan may stop: as soon as no state of the unread switches could change who wins.

Among sums that leave the unread switches out, let l be the leader. Class r can still overtake l if its score and the
most that the unread switches can bring it closer (reach.py) exceed l's; or equal it, where r has the lower number and
would win the tie. `EarlyExit` stops when no r can. It stops no later than that either: while it goes on, there is a
state of the unread switches in which somebody else wins.
"""

from collections.abc import Sequence
from functools import lru_cache
from operator import add

from thenar.drivers.errors import SettingError

from ..live.frames import Mask
from ..live.scores import LiveScores
from ..tables import IntegerTables
from .reach import Reach

_KEPT = 1 << 16


class EarlyExit:
    """Watches a scan port by port.

    groups are the switches of each port, in the order in which ports are read; no switch may be in two of them. With a
    `lead` in steps, the scan goes on until the leader is sure to lead everybody by so much: a decision that asks for
    such a lead (`Policy.lead`) is then the same as after the whole scan.
    """

    def __init__(self, tables: IntegerTables, groups: Sequence[Mask], *, lead: int = 0) -> None:
        """Raise SettingError if a switch is in two groups or is none of the tables'."""
        self._groups = tuple(groups)
        self._later = _later(self._groups, tables.n_switches)
        self._lead = lead
        self._scores = LiveScores(tables)
        self._reach = Reach(tables)
        self._hurdles = lru_cache(maxsize=_KEPT // tables.n_classes)(self._hurdles_of)
        self._elsewhere: Mask = ~sum(self._groups) & ((1 << tables.n_switches) - 1)
        self._closed: Mask = 0
        self._lost: Mask = 0

    def start(self, codes: Sequence[int] | None, closed: Mask = 0, lost: Mask | None = None) -> None:
        """Begin a scan: the joints' codes (None: lost), and what is known of switches that are of no port.

        With lost=None all of those are lost. Raises FrameError.
        """
        self._closed = closed & self._elsewhere
        self._lost = self._elsewhere if lost is None else lost & self._elsewhere
        self._scores.joints(codes)

    def after(self, port: int, closed: Mask, lost: Mask = 0) -> bool:
        """Take what port number `port` read, of its own switches; return whether the ports after it can be left out.

        Ports come in order. After the last, with no `lead`, the answer is always yes.
        """
        group = self._groups[port]
        self._closed |= closed & group
        self._lost |= lost & group
        self._scores.switches(self._closed, self._lost)
        lanes = self._scores.lanes()
        best = max(lanes)
        nearest: int = max(map(add, lanes, self._hurdles(port, lanes.index(best))))
        return nearest <= best

    def unread(self, port: int) -> Mask:
        """Return the switches of the ports after number `port`."""
        return self._later[port]

    def _hurdles_of(self, port: int, leader: int) -> tuple[int, ...]:
        """Return what, added to a class's score, must not exceed the leader's: (K,), 0 for the leader itself."""
        found = [
            reach + max(self._lead, rival < leader)
            for rival, reach in enumerate(self._reach.of(leader, self._later[port]))
        ]
        found[leader] = 0
        return tuple(found)


def _later(groups: Sequence[Mask], n_switches: int) -> list[Mask]:
    """Return, for every group, the switches of the groups after it."""
    later, seen = [], 0
    for group in reversed(groups):
        later.append(seen)
        if group & seen or group >> n_switches:
            raise SettingError("a switch of the scan is read by two ports, or is none of the build's: compile it again")
        seen |= group
    return later[::-1]
