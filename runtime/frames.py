"""The data from devices: the newest state of the switches and the newest record of the glove, each with its time.

Times are integer microseconds of the host's monotonic clock, which no change of the date affects. A set of switches is
one Python integer: bit k is switch k of the requested list (a build's kept switches, in the build's order).
"""

from collections.abc import Iterable
from time import monotonic_ns
from typing import Generic, TypeVar

from msgspec import Struct

Mask = int

# Bit of the CyberGlove's status byte: the glove is plugged into its box.
_PLUGGED = 1


def now_us() -> int:
    """Return the host's monotonic clock in microseconds."""
    return monotonic_ns() // 1000


class GloveFrame(Struct, frozen=True):
    """One record of the CyberGlove: arrival time of its last byte, its sensors' bytes in wire order, and its status
    byte if the glove sends one.
    """

    time_us: int
    sensors: bytes
    status: int | None = None

    @property
    def plugged(self) -> bool:
        """Whether the glove is plugged into its box, as far as its status says."""
        return self.status is None or bool(self.status & _PLUGGED)


class SwitchFrame(Struct, frozen=True):
    """One reading of the switches.

    time_us  when the last port was read
    closed   which switches are closed
    lost     which could not be read, because a port is silent (their bits in `closed` mean nothing)
    glove    the record of the joints that was read with it, as in a row of both; None: the newest goes with it
    taxels   the codes of the harness's taxels, in order, None for those that were not read; None: none was
    """

    time_us: int
    closed: Mask
    lost: Mask = 0
    glove: GloveFrame | None = None
    taxels: tuple[int | None, ...] | None = None


# Data of this age is no longer shown, or used, as if it were of now; slow sources have three periods.
OLD_US = 500_000
_OLD_PERIODS = 3


def old_after_us(*periods_us: int | None) -> int:
    """Return the age from which data of sources with these periods is old; None: there is no such source."""
    return max(OLD_US, *(_OLD_PERIODS * (period or 0) for period in periods_us))


# A frame is current for this many of its periods: one more may be late, two may not.
PERIODS = 2
F = TypeVar("F", SwitchFrame, GloveFrame)


class Newest(Generic[F]):
    """The newest frame of a device, and its expiry, which is fixed when it arrives.

    A frame with a time in the future gets its arrival time: whatever a device's clock says, a frame ages from then on.


    frame       None before the first
    time_us     when it was read; -1 before the first
    expires_us  its expiry
    """

    __slots__ = ("expires_us", "frame", "time_us")

    def __init__(self) -> None:
        self.frame: F | None = None
        self.time_us = self.expires_us = -1

    def take(self, frame: F, now_us: int, longest_us: int) -> None:
        """Take a frame that has arrived by now: the same again, or another, which is current for `longest_us` from its
        reading time; one older than the newest is dropped.
        """
        last = self.frame
        # Times first: comparing whole frames takes longer, and they are seldom equal.
        if last is not None and frame.time_us == last.time_us and frame == last:
            return
        time_us = min(frame.time_us, now_us)
        if time_us >= self.time_us:
            self.frame, self.time_us, self.expires_us = frame, time_us, time_us + longest_us


def bits(mask: Mask) -> list[Mask]:
    """Return the single bits of `mask`, the lowest first."""
    found = []
    while mask:
        found.append(mask & -mask)
        mask &= mask - 1
    return found


class BitRemap:
    """Converts a set of a device's bits to a set of switches, as given by `pairs` (bit, switch).

    A call costs a lookup as long as nothing changes: a hand rests for many scans.
    """

    __slots__ = ("_last", "_pairs", "_turned", "targets")

    def __init__(self, pairs: Iterable[tuple[int, int]]) -> None:
        self._pairs = tuple((1 << bit, 1 << switch) for bit, switch in pairs)
        self.targets: Mask = sum(switch for _, switch in self._pairs)
        self._last, self._turned = 0, 0

    def __call__(self, bits: Mask) -> Mask:
        """Return the switches of the device's `bits`."""
        if bits != self._last:
            self._turned = sum([switch for bit, switch in self._pairs if bits & bit])
            self._last = bits
        return self._turned
