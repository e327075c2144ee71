"""What every source is: a device that is opened, read in a thread of its own, and opened again when it comes back."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields
from typing import Any, Literal

from thenar.drivers.debounce import Debouncer
from thenar.drivers.members import Members

from ..calibration import Joints
from ..frames import GloveFrame, Mask, Newest, SwitchFrame
from ..harness.wiring import Debounce, Harness
from ..published import Count
from ..scanning.decided import EarlyExit
from ..scanning.scanmap import ScanMap

# A device is expected back at least so often, however fast it is: less would take a busy computer, or the 16 ms for
# which a USB serial adapter may gather bytes, for a cut cable.
SHORTEST_US = 10_000

ExitOf = Callable[[Sequence[Mask]], EarlyExit]


class Source(ABC):
    """One device that delivers frames. A source of your own derives from this; its constructor opens nothing.

    Attributes
    ----------
    name : str
        What messages call it, with its port: "scanner at /dev/ttyACM0".
    owned : int
        The switches that it reads, as bits of the frames; 0 for a source of joints.
    period_us : int
        How often a frame should come. It may change with `open`.
    longest_us : int
        For how long a frame counts, from the time at which it was read: two periods, PERIODS * period_us, as a rule.
    """

    name: str
    period_us: int
    longest_us: int
    owned: Mask = 0

    @abstractmethod
    def open(self) -> None:
        """Open the device and make it ready.

        Raises DeviceError where another try may help, SettingError where none does.
        """

    @abstractmethod
    def read(self, timeout_s: float) -> SwitchFrame | GloveFrame | None:
        """Return the next frame, None if there is none in time. Raises DeviceError when the device is gone."""

    @abstractmethod
    def close(self) -> None:
        """Close the device, in whatever state it is."""

    def counts(self) -> tuple[Count, ...]:
        """Return what is counted of frames and faults; health shows it."""
        return ()

    def trouble(self) -> str:
        """Return what is wrong though the device is open; "" if nothing is."""
        return ""

    def read_only(self, sensors: Sequence[str], *, on_demand: bool) -> None:  # noqa: B027
        """Be allowed to leave out of its frames, as 0, what sensors but these measure; and `on_demand` to deliver
        frames only when asked for one. Called before `open`; what reads switches, or sends by itself, ignores it.
        """

    def ask(self) -> None:  # noqa: B027
        """Be asked for a frame, on demand."""

    def end_early(self, exit_of: ExitOf, joints: Joints, glove: Newest[GloveFrame]) -> None:  # noqa: B027
        """Be allowed to leave switches unread that cannot change an answer: this source reads all that there are.

        `exit_of` makes of the switches of each port what says when a scan may stop, given the codes that `joints` makes
        of the newest record of the `glove`. A source that reads everything at once has no use for it.
        """

    def leave_out(self, switches: Mask, joints: Mask) -> None:  # noqa: B027
        """Hear which switches and joints are scored as lost, though they are read: where scans end early."""


@dataclass(frozen=True, slots=True)
class SourceKind:
    """A kind of source: which devices of a harness are of it, and how often they deliver.

    A module of `thenar.runtime.sources` defines one as `MEMBER`; another package names one under the entry point
    `thenar.sources`.

    Attributes
    ----------
    name : str
        What people call it: "scanner".
    help : str
        A sentence on what it reads.
    reads : {"switches", "joints"}
        What its frames hold.
    sources : callable
        `sources(harness, switch_names, scan)` yields a `Source` for each device. Switch k of the frames is
        `switch_names[k]`; `scan` says which ports to read, in which order, and where levels of taxels close: at limits
        of this glove's counts (`taxels.count_limit`), once a build has been put together with it.
    periods_us : callable
        `periods_us(harness, scan)` yields how often each of them should deliver at least. Nothing is opened for it: a
        replay asks, too.
    rank : int
        Orders the kinds.
    """

    name: str
    help: str
    reads: Literal["switches", "joints"]
    sources: Callable[[Harness, Sequence[str], ScanMap], Iterable[Source]]
    periods_us: Callable[[Harness, ScanMap], Iterable[int]]
    rank: int = 0


SOURCES = Members("source", SourceKind, "thenar.runtime.sources", "thenar.sources")


def slowest_us(harness: Harness, scan: ScanMap, reads: Literal["switches", "joints"]) -> int | None:
    """Return how often switches or joints should come at least; None where nothing reads them."""
    kinds = [kind for kind in SOURCES.values() if kind.reads == reads]
    return max((us for kind in kinds for us in kind.periods_us(harness, scan)), default=None)


def counted(counts: Any) -> tuple[Count, ...]:
    """Return a dataclass of numbers as counts."""
    return tuple(Count(field.name.replace("_", " "), getattr(counts, field.name)) for field in fields(counts))


def debouncer_of(debounce: Debounce) -> Debouncer | None:
    """Return what debounces as `debounce` says; None: nothing does."""
    if not debounce.enabled:
        return None
    return Debouncer(round(debounce.press_lockout_ms * 1000), round(debounce.release_ms * 1000))


def pause_us(debounce: Debounce) -> int:
    """Return for how long a switch must not have been read for nothing of it to bounce any more.

    What was closed before such a pause may have opened: it is no reason to believe it closed.
    """
    return round(2000 * max(debounce.press_lockout_ms, debounce.release_ms))
