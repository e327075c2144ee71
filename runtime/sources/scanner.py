"""Scanner boards of a harness."""

from collections.abc import Iterator, Sequence
from math import ceil

from thenar.drivers.scanner import Scanner
from thenar.drivers.serial_line import BITS_A_BYTE

from ..frames import PERIODS, Pauses, Rewired, SwitchFrame
from ..harness.wiring import Debounce, Harness, ScannerWiring
from ..published import Count
from ..scanning.scanmap import ScanMap
from .base import SHORTEST_US, Source, SourceKind, counted, debouncer_of, pause_us

# A board that speaks less often is asked for a heartbeat, beside an event for every change: silence is missed sooner.
STATE_US = SHORTEST_US

# The round trip of a PING on a good line: an adapter's 16 ms and the board's answer; and its bytes, both ways.
_ANSWERED_US = 20_000
_PING_BYTES = 8 + 41


class ScannerDevice(Source):
    """A scanner board, its keys debounced and turned into the switches that are asked for."""

    def __init__(self, wiring: ScannerWiring, switch_names: Sequence[str], debounce: Debounce) -> None:
        number = {name: place for place, name in enumerate(switch_names)}
        self.name = f"scanner at {wiring.port}"
        self.driver = Scanner(wiring.port, wiring.baud)
        self._switches = Rewired((key, number[name]) for key, name in enumerate(wiring.switches) if name in number)
        self._known = Rewired((key, number[name]) for key, name in enumerate(wiring.switches) if name in number)
        self.owned = self._switches.targets
        self.period_us, self.longest_us = STATE_US, PERIODS * STATE_US
        self._usual_us, self._time_us = _usual_trip_us(wiring), 0
        self._debounce, self._debouncer, self._pauses = debounce, debouncer_of(debounce), Pauses(pause_us(debounce))

    def open(self) -> None:
        """Open the board, and see to it that it is not silent for long while all is well."""
        hello = self.driver.open()
        # What was closed before the board was away is no reason to believe it closed now.
        self._debouncer, self._pauses = debouncer_of(self._debounce), Pauses(pause_us(self._debounce))
        fast = 0 < hello.period_us <= STATE_US
        self.period_us = hello.period_us if fast else STATE_US
        if not fast:
            self.driver.set_rate(hello.scan_us, 0, STATE_US)

    def read(self, timeout_s: float) -> SwitchFrame | None:
        """Return the next reading, at the earliest time at which the board can have sent it."""
        reading = self.driver.read(timeout_s)
        if reading is None:
            return None
        closed, known = self._switches(reading.closed), self._known(reading.known)
        if self._debouncer is not None:
            if over := self._pauses.over(reading.time_us, known):
                self._debouncer.forget(over)
            closed = self._debouncer.update(reading.time_us, closed, known) & known
        trip_us = self.driver.times.clock.trip_us
        # A frame may be older than two periods by the round trip of a good line, no more.
        self.longest_us = PERIODS * self.period_us + min(trip_us, self._usual_us)
        self._time_us = max(self._time_us, reading.time_us - trip_us)
        return SwitchFrame(self._time_us, closed, self.owned & ~known)

    def counts(self) -> tuple[Count, ...]:
        """Return what the driver counts."""
        return counted(self.driver.counts)

    def close(self) -> None:
        """Close the board."""
        self.driver.close()


def _usual_trip_us(wiring: ScannerWiring) -> int:
    """Return how long a PING to a board so wired and its answer may take on a good line."""
    return _ANSWERED_US + round(_PING_BYTES * BITS_A_BYTE * 1e6 / wiring.baud)


def _sources(harness: Harness, names: Sequence[str], _scan: ScanMap) -> Iterator[Source]:
    return (ScannerDevice(wiring, names, harness.debounce) for wiring in harness.scanners)


def _periods_us(harness: Harness, scan: ScanMap) -> Iterator[int]:
    """Yield for each board that is read how often it should be heard of, the round trip of a good line included."""
    boards = zip(harness.scanners, scan.scanners, strict=True)
    return (STATE_US + ceil(_usual_trip_us(wiring) / PERIODS) for wiring, keys in boards if keys)


MEMBER = SourceKind(
    "scanner", "A switch-scanner board on a serial line: [[scanner]].", "switches", _sources, _periods_us
)
