"""The interface of all sources: a device that is read in a separate thread, and reopened when it comes back."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields
from typing import Any

from msgspec import Struct

from thenar.drivers.errors import SettingError
from thenar.drivers.members import Members

from ..frames import GloveFrame, Mask, SwitchFrame, bits
from ..harness.wiring import Debounce, Harness
from ..names import list_names
from ..published import Count
from ..scanning.scanmap import ScanMap
from ..taxels import LiveTaxel, TaxelCalibration

# A device is expected back at least this often, however fast it is: a shorter limit would mistake a busy computer, or
# the 16 ms for which a USB serial adapter may buffer bytes, for a cut cable.
SHORTEST_US = 10_000
# Counts that say nothing of faults.
_USUAL = {"transfers", "rows", "rows a second", "records"}


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
    taxels : sequence of LiveTaxel
        The taxels that it reads.
    reads_joints : bool
        Whether it delivers records of joints.
    part : str
        What the device says it is, once it is open; "" if it says nothing.
    notes : sequence of str
        Oddities of an open device that are no faults, in sentences.
    """

    name: str
    period_us: int
    longest_us: int
    owned: Mask = 0
    taxels: Sequence[LiveTaxel] = ()
    reads_joints: bool = False
    part: str = ""
    notes: Sequence[str] = ()

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

    @property
    def wire_us(self) -> float:
        """The least time from frame to frame, by the arithmetic of its wire."""
        return self.period_us

    def faults(self) -> str:
        """Return the counts of what did not work, or lacked something: "late 3, gaps 1"."""
        wrong = (count for count in self.counts() if count.value and count.name not in _USUAL)
        return ", ".join(f"{count.name} {count.value}" for count in wrong)

    def fault_message(self) -> str:
        """Return the fault of an open device; "" if there is none."""
        return ""

    def taxel_faults(self) -> str:
        """Return a sentence on the taxels with faults, "" without any; silent ones are reported with their device."""
        faulty = [f"{taxel.name}: {taxel.fault}" for taxel in self.taxels if taxel.fault not in ("", "silent")]
        return f"taxels with faults: {list_names(faulty)}" if faulty else ""

    def read_only(self, sensors: Sequence[str]) -> None:  # noqa: B027
        """Allow the source to leave other joints' sensors than these out of its frames, as 0, and taxels without
        levels. Called before `open`, for a build; sources of switches alone ignore it.
        """


class SourceKind(Struct, frozen=True):
    """A kind of source, and its devices in a harness.

    A module of `thenar.runtime.sources` defines one as `MEMBER`; another package registers one under the entry point
    `thenar.sources`.

    Attributes
    ----------
    name : str
        Its name: "cyberglove".
    sources : callable
        `sources(harness, switch_names, scan, taxels)` yields a `Source` for each device, without opening anything: a
        replay calls it, too. Switch k of the frames is `switch_names[k]`; `scan` gives the ports to read, in order, and
        the limits at which levels of taxels close: in this glove's counts (`taxels.count_limit`), once a build has been
        combined with it. `taxels` is their calibration, or None.
    rank : int
        Orders the kinds.
    """

    name: str
    sources: Callable[[Harness, Sequence[str], ScanMap, TaxelCalibration | None], Iterable[Source]]
    rank: int = 0


SOURCES = Members("source", SourceKind, "thenar.runtime.sources", "thenar.sources")


def sources_of(
    harness: Harness, switch_names: Sequence[str], scan: ScanMap, taxels: TaxelCalibration | None = None
) -> tuple[Source, ...]:
    """Return the devices of a harness; the arguments are those of `SourceKind.sources`."""
    return tuple(source for kind in SOURCES.values() for source in kind.sources(harness, switch_names, scan, taxels))


def slowest_us(sources: Iterable[Source]) -> int | None:
    """Return the longest expected period of these; None if there are none."""
    return max((source.period_us for source in sources), default=None)


def paced_us(rate_hz: float) -> int:
    """Return the longest period that is expected of a device that is read `rate_hz` times a second."""
    return max(SHORTEST_US, round(1e6 / rate_hz))


def counted(counts: Any) -> tuple[Count, ...]:
    """Return a dataclass of numbers as counts."""
    return tuple(Count(field.name.replace("_", " "), getattr(counts, field.name)) for field in fields(counts))


class Debouncer:
    """Debounced switch states from raw readings: a press is reported as soon as it is read, a release once the contact
    has been open long enough.

    A snap-action switch bounces for up to 3 ms when it closes and 8 ms when it opens (Panasonic EVQPL; other tact
    switches 10 ms). Presses are eager, with a lockout; releases are deferred, as is usual where a press must not wait
    (QMK's `asym_eager_defer_pk`). All switches are processed together as bits of one integer.

    press_lockout_us  readings of a switch are ignored for this time after its press
    release_us        a switch opens once all its readings were open for this time. A release is not deferred to a scan
                      that comes after this time: if scans are further apart than release_us / 2, a release takes fewer
                      than two scans. Closed readings within release_us of the opening count as bounce and are ignored.

    A switch that was not read for twice the longer of both begins anew, as open: its bounces are over, and it may have
    opened and closed since.

    Raises SettingError for a negative time.
    """

    def __init__(self, press_lockout_us: int = 5_000, release_us: int = 10_000) -> None:
        if press_lockout_us < 0 or release_us < 0:
            raise SettingError(f"debounce times are 0 or more, not {press_lockout_us} us and {release_us} us")
        self.press_lockout_us, self.release_us = press_lockout_us, release_us
        self._pause_us = 2 * max(press_lockout_us, release_us)
        self._closed: Mask = 0
        self._time: int | None = None
        self._period: int | None = None
        # Read in the last update; and of the others, by their bits, the time of their last reading.
        self._known: Mask = 0
        self._unread: dict[Mask, int] = {}
        # By bits of switches: ignored until a time; read open since a time. No switch is in both.
        self._locks: dict[Mask, int] = {}
        self._openings: dict[Mask, int] = {}

    def update(self, time_us: int, closed: Mask, known: Mask) -> Mask:
        """Return the closed switches after a reading of those in `known` at `time_us`, with `closed` among them closed.

        Switches that were not read keep their state, and their timers run on. A time that goes back is ignored.
        """
        if self._time is None:
            self._time = time_us
        interval = max(0, time_us - self._time)
        if interval > self._pause_us or known != self._known:
            self._forget_after_pauses(self._time, interval, known)
        self._time = now = self._time + interval
        # The shortest recent period is the earliest time of the next reading.
        if self._period is None or interval <= self._period:
            self._period = interval or self._period
        else:
            self._period = min(interval, self._period + (self._period >> 2) + 1)
        self._locks = {switch: until for switch, until in self._locks.items() if until > now}
        free = known & ~sum(self._locks)
        pressed = closed & free & ~self._closed
        for switch in bits(~closed & free & self._closed):
            since = self._openings.setdefault(switch, now)
            # Open for long enough, or before the next reading: its bounce is locked out.
            if now + (self._period or 0) >= since + self.release_us:
                self._closed ^= switch
                self._locks[switch] = self._openings.pop(switch) + self.release_us
        _drop(self._openings, closed & free)
        self._closed |= pressed
        self._locks |= dict.fromkeys(bits(pressed), now + self.press_lockout_us)
        return self._closed

    def _forget_after_pauses(self, last_us: int, interval: int, known: Mask) -> None:
        """Take which switches are read, `interval` after the last reading; begin anew with those that had a pause."""
        times = self._unread | dict.fromkeys(bits(self._known), last_us)
        latest_us = last_us + interval - self._pause_us
        over = sum(switch for switch, time_us in times.items() if switch & known and time_us < latest_us)
        self._unread = {switch: time_us for switch, time_us in times.items() if not switch & known}
        self._known = known
        self._closed &= ~over
        for timers in (self._locks, self._openings):
            _drop(timers, over)


def _drop(timers: dict[Mask, int], switches: Mask) -> None:
    """Remove the timers of these switches."""
    for switch in [each for each in timers if each & switches]:
        del timers[switch]


def debouncer_of(debounce: Debounce) -> Debouncer | None:
    """Return a debouncer for `debounce`, or None if nothing is debounced."""
    if not debounce.enabled:
        return None
    return Debouncer(round(debounce.press_lockout_ms * 1000), round(debounce.release_ms * 1000))
