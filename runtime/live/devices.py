"""The devices of a harness as what `Keeper` keeps, each giving the frames of the live loop."""

from collections.abc import Sequence
from dataclasses import fields
from math import ceil
from typing import Any

from thenar.drivers.cyberglove import CyberGlove
from thenar.drivers.cyberglove_protocol import shortest_us
from thenar.drivers.debounce import Debouncer
from thenar.drivers.scanner import Scanner
from thenar.drivers.serial_line import BITS_A_BYTE

from ..harness.wiring import Debounce, GloveWiring, ScannerWiring
from .frames import GloveFrame, SwitchFrame
from .health import Count
from .newest import PERIODS
from .pauses import Pauses
from .rewiring import Rewired

# A device is expected back at least so often, however fast it is: less would take a busy computer, or the 16 ms for
# which a USB serial adapter may gather bytes, for a cut cable.
SHORTEST_US = 10_000
# A board that speaks less often is asked for a heartbeat, beside an event for every change: silence is missed sooner.
STATE_US = SHORTEST_US

# The round trip of a PING on a good line: an adapter's 16 ms and the board's answer; and its bytes, both ways.
_ANSWERED_US = 20_000
_PING_BYTES = 8 + 41

_SLOWEST_BAUD = 9_600
_SENSORS = 18


class GloveDevice:
    """The CyberGlove of a harness. A record that says the glove is unplugged is no frame: it holds no measurement."""

    def __init__(self, wiring: GloveWiring) -> None:
        self.name = f"cyberglove at {wiring.port}"
        self.sensors = sensors_of(wiring)
        self._unplugged = False
        self.driver = CyberGlove(
            wiring.port,
            baud=None if wiring.baud == "auto" else wiring.baud,
            mode=wiring.mode,
            rate_hz=wiring.rate_hz,
            sensors=self.sensors,
        )
        self.period_us = glove_period_us(wiring)

    def open(self) -> None:
        """Open the glove."""
        self.driver.open()

    def read(self, timeout_s: float) -> GloveFrame | None:
        """Return the next record that holds a measurement."""
        timed = self.driver.read(timeout_s)
        if timed is None:
            return None
        self._unplugged = timed[1].fault == "unplugged"
        if self._unplugged:
            return None
        time_us, record = timed
        return GloveFrame(time_us, record.sensors, record.status)

    def counts(self) -> tuple[Count, ...]:
        """Return what the driver counts."""
        return counted(self.driver.counts)

    def trouble(self) -> str:
        """Return what is wrong though the line is open; "" if nothing is."""
        return "the glove is not plugged into its box" if self._unplugged else ""

    def close(self) -> None:
        """Close the glove."""
        self.driver.close()


class ScannerDevice:
    """A scanner board of a harness, its keys debounced and turned into the switches that are asked for."""

    def __init__(self, wiring: ScannerWiring, switch_names: Sequence[str], debounce: Debounce) -> None:
        number = {name: place for place, name in enumerate(switch_names)}
        self.name = f"scanner at {wiring.port}"
        self.driver = Scanner(wiring.port, wiring.baud)
        self._switches = Rewired((key, number[name]) for key, name in enumerate(wiring.switches) if name in number)
        self.owned = self._switches.targets
        self.period_us = STATE_US
        self._usual_us, self._time_us = usual_trip_us(wiring), 0
        self._debounce, self._debouncer, self._pauses = debounce, debouncer_of(debounce), Pauses(pause_us(debounce))

    @property
    def longest_us(self) -> int:
        """For how long a frame counts: it may be older than two periods by the round trip of a good line, no more."""
        return PERIODS * self.period_us + min(self.driver.trip_us, self._usual_us)

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
        closed, known = self._switches(reading.closed), self._switches(reading.known)
        if self._debouncer is not None:
            self._debouncer.forget(self._pauses.over(reading.time_us, known))
            closed = self._debouncer.update(reading.time_us, closed, known) & known
        self._time_us = max(self._time_us, reading.time_us - self.driver.trip_us)
        return SwitchFrame(self._time_us, closed, self.owned & ~known)

    def counts(self) -> tuple[Count, ...]:
        """Return what the driver counts."""
        return counted(self.driver.counts)

    def trouble(self) -> str:
        """Return what is wrong though the line is open; "" if nothing is."""
        return ""

    def close(self) -> None:
        """Close the board."""
        self.driver.close()


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


def usual_trip_us(wiring: ScannerWiring) -> int:
    """Return how long a PING to a board so wired and its answer may take on a good line."""
    return _ANSWERED_US + round(_PING_BYTES * BITS_A_BYTE * 1e6 / wiring.baud)


def board_period_us(wiring: ScannerWiring) -> int:
    """Return how often a board so wired should be heard of at least, the round trip of a good line included."""
    return STATE_US + ceil(usual_trip_us(wiring) / PERIODS)


def glove_period_us(wiring: GloveWiring) -> int:
    """Return how often a CyberGlove so wired should send at least; the slowest that it can be where that is open.

    One that is asked for more than box and line can do sends as fast as they can.
    """
    baud = _SLOWEST_BAUD if wiring.baud == "auto" else wiring.baud
    shortest = round(shortest_us(sensors_of(wiring), baud, status=True, filtered=True))
    return max(SHORTEST_US, shortest, round(1e6 / wiring.rate_hz) if wiring.rate_hz else 0)


def sensors_of(wiring: GloveWiring) -> int:
    """Return how many sensors a CyberGlove so wired must have: 18 where nothing says so."""
    return len(wiring.joints) or wiring.sensors or _SENSORS
