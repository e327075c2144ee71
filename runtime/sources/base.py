"""The interface of all sources: a device that is read in a separate thread, and reopened when it comes back."""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields
from typing import Any, Literal

from msgspec import Struct

from thenar.drivers.debounce import Debouncer
from thenar.drivers.members import Members

from ..frames import GloveFrame, Mask, SwitchFrame
from ..harness.wiring import Debounce, Harness
from ..published import Count
from ..scanning.scanmap import ScanMap

# A device is expected back at least this often, however fast it is: a shorter limit would mistake a busy computer, or
# the 16 ms for which a USB serial adapter may buffer bytes, for a cut cable.
SHORTEST_US = 10_000


class Pace:
    """Limits the readings of a device to `rate_hz` a second."""

    def __init__(self, rate_hz: float) -> None:
        self._period_s, self._due_s = 1.0 / rate_hz, 0.0

    def wait(self, timeout_s: float) -> bool:
        """Wait until the next reading is due, but no longer than `timeout_s`; return whether it is."""
        left_s = self._due_s - time.monotonic()
        if left_s > 0.0:
            time.sleep(min(left_s, timeout_s))
        if left_s > timeout_s:
            return False
        now_s, next_s = time.monotonic(), self._due_s + self._period_s
        # No reading makes up for a late one.
        self._due_s = next_s if next_s > now_s else now_s + self._period_s
        return True


class Source(ABC):
    """One device that delivers frames. To write your own, derive from this; its constructor opens nothing.

    Attributes
    ----------
    name : str
        Its name in messages, with its port: "cyberglove at /dev/ttyUSB0".
    owned : int
        The switches that it reads, as bits of the frames; 0 for a source of joints.
    period_us : int
        The expected time from frame to frame. It may change with `open`.
    longest_us : int
        How long a frame is current, from its reading time: usually two periods, PERIODS * period_us.
    """

    name: str
    period_us: int
    longest_us: int
    owned: Mask = 0

    @abstractmethod
    def open(self) -> None:
        """Open the device and make it ready.

        Raises DeviceError if another try may help, SettingError if none does.
        """

    @abstractmethod
    def read(self, timeout_s: float) -> SwitchFrame | GloveFrame | None:
        """Return the next frame, or None if none arrives in time. Raises DeviceError when the device is gone."""

    @abstractmethod
    def close(self) -> None:
        """Close the device, in whatever state it is."""

    def counts(self) -> tuple[Count, ...]:
        """Return the counts of frames and faults, for health reports."""
        return ()

    def fault_message(self) -> str:
        """Return the fault of an open device; "" if there is none."""
        return ""

    def read_only(self, sensors: Sequence[str]) -> None:  # noqa: B027
        """Allow the source to leave other joints' sensors than these out of its frames, as 0, and taxels without
        levels. Called before `open`, for a build; sources of switches alone ignore it.
        """


class SourceKind(Struct, frozen=True):
    """A kind of source: its devices in a harness, and their periods.

    A module of `thenar.runtime.sources` defines one as `MEMBER`; another package registers one under the entry point
    `thenar.sources`.

    Attributes
    ----------
    name : str
        Its name for users: "cyberglove".
    help : str
        A sentence on the devices that it reads.
    reads : {"switches", "joints"}
        The content of its frames.
    sources : callable
        `sources(harness, switch_names, scan)` yields a `Source` for each device. Switch k of the frames is
        `switch_names[k]`; `scan` gives the ports to read, in order, and the limits at which levels of taxels close: in
        this glove's counts (`taxels.count_limit`), once a build has been combined with it.
    periods_us : callable
        `periods_us(harness, scan)` yields the longest expected period of each of them, without opening anything: a
        replay calls it, too.
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
    """Return the longest expected period of switches or joints; None if nothing reads them."""
    kinds = [kind for kind in SOURCES.values() if kind.reads == reads]
    return max((us for kind in kinds for us in kind.periods_us(harness, scan)), default=None)


def paced_us(rate_hz: float) -> int:
    """Return the longest period that is expected of a device that is read `rate_hz` times a second."""
    return max(SHORTEST_US, round(1e6 / rate_hz))


def counted(counts: Any) -> tuple[Count, ...]:
    """Return a dataclass of numbers as counts."""
    return tuple(Count(field.name.replace("_", " "), getattr(counts, field.name)) for field in fields(counts))


def debouncer_of(debounce: Debounce) -> Debouncer | None:
    """Return a debouncer for `debounce`, or None if nothing is debounced."""
    if not debounce.enabled:
        return None
    return Debouncer(round(debounce.press_lockout_ms * 1000), round(debounce.release_ms * 1000))
