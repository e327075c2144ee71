"""Scanner boards of a harness."""

from collections.abc import Iterator, Sequence
from math import ceil

from thenar.drivers.scanner import Scanner
from thenar.drivers.scanner_protocol import Channels
from thenar.drivers.serial_line import BITS_A_BYTE

from ..frames import PERIODS, Mask, Pauses, Rewired, SwitchFrame
from ..harness.wiring import Harness, ScannerWiring
from ..names import list_names
from ..published import Count
from ..scanning.scanmap import ScanMap
from ..scanning.timing import analog_us
from ..taxels import Level, Taxels, calibration_of
from .base import SHORTEST_US, Source, SourceKind, counted, debouncer_of, pause_us

# A board that sends less often is asked for a heartbeat, next to an event for every change, to notice silence sooner.
STATE_US = SHORTEST_US

# The round trip of a PING on a good line: an adapter's 16 ms and the board's reply; and its bytes, both ways.
_ANSWERED_US = 20_000
_PING_BYTES = 8 + 41


class _BoardTaxels:
    """The taxels of board number `number`: those with levels in `scan`, or all wired ones if `scan` has no levels.

    channels  the wanted ones, as bits; 0: none is requested from the board
    period_us from frame to frame; the line is free for at least half of the time
    """

    def __init__(self, harness: Harness, number: int, scan: ScanMap) -> None:
        wiring, everything = harness.scanners[number], harness.taxel_names
        levels: dict[int, list[Level]] = {}
        for channel, limit, switch in scan.taxels[number] if scan.taxels else ():
            levels.setdefault(channel, []).append((limit, switch))
        named = {} if scan.taxels else {channel: name for channel, name in enumerate(wiring.taxels) if name}
        asked = sorted(levels or named)
        self._names = [wiring.taxels[channel] for channel in asked]
        self._levels = [levels.get(channel, []) for channel in asked]
        self._places = [everything.index(name) for name in self._names]
        self._settings, self._calibration = harness.taxel_settings, calibration_of(harness.taxel_settings)
        self._everything = len(everything)
        self.channels: Mask = sum(1 << channel for channel in asked)
        self.owned: Mask = sum(1 << switch for each in levels.values() for _, switch in each)
        self.period_us = ceil(analog_us(len(asked), wiring.baud))
        self.begin()

    def begin(self) -> None:
        """Start afresh: nothing is known."""
        self.taxels: Taxels | None = None
        self._state: tuple[Mask, Mask, tuple[int | None, ...] | None] = 0, self.owned, None
        self._until_us = -1

    def take(self, time_us: int, codes: Sequence[int | None], measured: Channels) -> None:
        """Take the codes of the channels that the board measures."""
        if self.taxels is None:
            self.taxels = Taxels(
                self._names, self._levels, self._calibration, self._settings, highest=(1 << measured.bits) - 1
            )
        if measured.wanted != self.channels:  # it lacks some
            found = dict(zip(_bits(measured.wanted), codes, strict=True))
            codes = [found.get(channel) for channel in _bits(self.channels)]
        row: list[int | None] = [None] * self._everything
        for place, code in zip(self._places, codes, strict=True):
            row[place] = code
        self._state = *self.taxels.read(time_us, codes), tuple(row)
        self._until_us = time_us + PERIODS * measured.analog_us + STATE_US

    def at(self, time_us: int) -> tuple[Mask, Mask, tuple[int | None, ...] | None]:
        """Return closed and lost levels and the codes at a time; codes that are too old are dropped."""
        return self._state if time_us <= self._until_us else (0, self.owned, None)


def _bits(mask: Mask) -> list[int]:
    return [bit for bit in range(mask.bit_length()) if mask >> bit & 1]


class ScannerDevice(Source):
    """Scanner board number `number` of a harness: keys, debounced and mapped to the requested switches, and levels of
    its taxels as in `scan`, limits in counts.
    """

    def __init__(self, harness: Harness, number: int, switch_names: Sequence[str], scan: ScanMap) -> None:
        wiring, places = harness.scanners[number], {name: place for place, name in enumerate(switch_names)}
        self.name = f"scanner at {wiring.port}"
        self.driver = Scanner(wiring.port, wiring.baud)
        keys = [(key, places[name]) for key, name in enumerate(wiring.switches) if name in places]
        self._switches, self._known = Rewired(keys), Rewired(keys)
        self.taxels = _BoardTaxels(harness, number, scan)
        self.owned = self._switches.targets | self.taxels.owned
        self.period_us, self.longest_us = STATE_US, PERIODS * STATE_US
        self._usual_us, self._time_us = _usual_trip_us(wiring), 0
        debounce = self._debounce = harness.debounce
        self._debouncer, self._pauses = debouncer_of(debounce), Pauses(pause_us(debounce))

    def open(self) -> None:
        """Open the board, and make it send often enough to notice silence."""
        hello = self.driver.open()
        # A switch that was closed before the board was away must not be assumed closed now.
        self._debouncer, self._pauses = debouncer_of(self._debounce), Pauses(pause_us(self._debounce))
        fast = 0 < hello.period_us <= STATE_US
        self.period_us = hello.period_us if fast else STATE_US
        if not fast:
            self.driver.set_rate(hello.scan_us, 0, STATE_US)
        self.taxels.begin()
        if self.taxels.channels:
            self.driver.set_channels(self.taxels.period_us, self.taxels.channels)

    def read(self, timeout_s: float) -> SwitchFrame | None:
        """Return the next reading, at the earliest time at which the board can have sent it."""
        reading = self.driver.read(timeout_s)
        if reading is None:
            return None
        if reading.codes is not None and self.driver.analog is not None:
            self.taxels.take(reading.time_us, reading.codes, self.driver.analog)
        pressed, lost, taxels = self.taxels.at(reading.time_us)
        closed = self._switches(reading.closed) | pressed
        known = self._known(reading.known) | self.taxels.owned & ~lost
        if self._debouncer is not None:
            if over := self._pauses.over(reading.time_us, known):
                self._debouncer.forget(over)
            closed = self._debouncer.update(reading.time_us, closed, known) & known
        trip_us = self.driver.times.clock.trip_us
        # A frame may be older than two periods by the round trip of a good line, no more.
        self.longest_us = PERIODS * self.period_us + min(trip_us, self._usual_us)
        self._time_us = max(self._time_us, reading.time_us - trip_us)
        return SwitchFrame(self._time_us, closed, self.owned & ~known, taxels=taxels)

    def counts(self) -> tuple[Count, ...]:
        """Return the driver's counters."""
        return counted(self.driver.counts)

    def trouble(self) -> str:
        """Return the faults of taxels; "" if there are none."""
        if (taxels := self.taxels.taxels) is None:
            return ""
        faulty = [f"{name}: {fault}" for name, fault in zip(taxels.names, taxels.faults, strict=True) if fault]
        return f"taxels with faults: {list_names(faulty)}" if faulty else ""

    def close(self) -> None:
        """Close the board."""
        self.driver.close()


def _usual_trip_us(wiring: ScannerWiring) -> int:
    """Return the usual maximum time for a PING to a board with this wiring, and its reply, on a good line."""
    return _ANSWERED_US + round(_PING_BYTES * BITS_A_BYTE * 1e6 / wiring.baud)


def _sources(harness: Harness, names: Sequence[str], scan: ScanMap) -> Iterator[Source]:
    return (ScannerDevice(harness, number, names, scan) for number in range(len(harness.scanners)))


def _periods_us(harness: Harness, scan: ScanMap) -> Iterator[int]:
    """Yield the longest expected period of each board, including the round trip of a good line."""
    boards = zip(harness.scanners, scan.scanners, scan.taxels or [()] * len(scan.scanners), strict=True)
    return (STATE_US + ceil(_usual_trip_us(wiring) / PERIODS) for wiring, keys, levels in boards if keys or levels)


MEMBER = SourceKind(
    "scanner",
    "A scanner board of switches and taxels on a serial line: [[scanner]].",
    "switches",
    _sources,
    _periods_us,
)
