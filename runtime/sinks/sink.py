"""What every sink is: it publishes what is recognised, and neither waits nor raises while it does."""

from typing import Protocol

import msgspec

from thenar.drivers.errors import ThenarError

from ..live.health import HealthReport
from ..live.published import LiveGrasp
from ..preshape.preshape import Preshape
from .angles import JointAngles


class SinkError(ThenarError, OSError):
    """A sink cannot be opened: the name is taken, no such folder, a package is missing. The message says which."""


class SinkReport(msgspec.Struct, frozen=True):
    """How a sink is doing, since it was opened.

    where     as `open_sink` has it
    readers   how many read now; None where that cannot be known
    sent      what went out, counted once a reader
    lost      what did not: a reader was slow, was gone, or the system refused
    error     what went wrong last, or nothing
    over      whether nothing will go out any more: its only reader is gone, the disk is full, it broke
    dropped   how many readers were dropped, for they took nothing, or were the slowest when all places were taken
    """

    where: str
    readers: int | None
    sent: int
    lost: int
    error: str = ""
    over: bool = False
    dropped: int = 0


class Sink(Protocol):
    """Takes every frame's result. A sink of your own derives from this, and needs `publish` alone."""

    def publish(self, grasp: LiveGrasp, preshape: Preshape | None, angles: JointAngles | None) -> None:
        """Send on what was recognised. Never blocks and never raises: what cannot be sent is lost, and counted.

        preshape is what the hand shall have now, None where it shall be told nothing; angles are the glove's.
        """

    def health(self, report: HealthReport) -> None:
        """Send on how the glove fares, once a second or so. Never blocks and never raises, either."""

    def report(self) -> SinkReport:
        """Return how the sink itself is doing."""
        return SinkReport(type(self).__name__, None, 0, 0)

    def close(self) -> None:
        """Let go of everything; may be called twice."""
