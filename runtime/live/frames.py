"""What devices deliver: the newest state of the switches, the newest record of the glove, each with its own time.

Times are integer microseconds of the host's monotonic clock, which no change of the date can step. A set of switches is
one Python integer: bit k is switch k of the list that was asked for (a build's kept switches, in the build's order).
"""

from dataclasses import dataclass
from time import monotonic_ns

Mask = int

# Bit of the CyberGlove's status byte: the glove is plugged into its box.
_PLUGGED = 1


def now_us() -> int:
    """Return the host's monotonic clock in microseconds."""
    return monotonic_ns() // 1000


@dataclass(frozen=True, slots=True)
class GloveFrame:
    """One record of the CyberGlove: when its last byte came in, its sensors' bytes in wire order, and its status byte
    where the glove sends one.
    """

    time_us: int
    sensors: bytes
    status: int | None = None

    @property
    def plugged(self) -> bool:
        """Whether the glove is plugged into its box, as far as its status says."""
        return self.status is None or bool(self.status & _PLUGGED)


@dataclass(frozen=True, slots=True)
class SwitchFrame:
    """One reading of the switches.

    time_us  when the last port was read
    closed   which switches are closed
    lost     which could not be read (their bits in `closed` mean nothing): a port is silent
    unread   which were left unread, because with the joints of `glove` (None: lost) the leader could not be overtaken
             any more; joined with another frame of the glove, nothing would be certain
    glove    the glove's frame to join this one with, where the scan could have ended by it; None: the newest
    """

    time_us: int
    closed: Mask
    lost: Mask = 0
    unread: Mask = 0
    glove: GloveFrame | None = None
