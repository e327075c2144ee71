"""The CyberGlove of a harness."""

from collections.abc import Iterator, Sequence
from threading import Event

from thenar.drivers.cyberglove import CyberGlove, GloveInfo
from thenar.drivers.cyberglove_protocol import shortest_us

from ..frames import PERIODS, GloveFrame
from ..harness.wiring import GloveWiring, Harness
from ..published import Count
from ..scanning.scanmap import ScanMap
from .base import SHORTEST_US, Source, SourceKind, counted

_SLOWEST_BAUD = 9_600


class GloveDevice(Source):
    """A CyberGlove. A record that says the glove is unplugged is no frame: it holds no measurement.

    info  what was found at the end of the line when it was opened last
    """

    def __init__(self, wiring: GloveWiring) -> None:
        self.name = f"cyberglove at {wiring.port}"
        self.sensors = wiring.all_sensors
        self.period_us = glove_period_us(wiring)
        self.longest_us = PERIODS * self.period_us
        self._wiring, self._unplugged = wiring, False
        self._asked: Event | None = None
        self.info: GloveInfo | None = None
        self.driver = self._driver(None)

    def _driver(self, only: tuple[int, ...] | None) -> CyberGlove:
        wiring = self._wiring
        return CyberGlove(
            wiring.port,
            baud=None if wiring.baud == "auto" else wiring.baud,
            mode="stream" if wiring.mode == "stream" else "poll",
            rate_hz=wiring.rate_hz,
            sensors=self.sensors,
            only=only,
            filtered=wiring.filter,
        )

    def read_only(self, sensors: Sequence[str], *, on_demand: bool = False) -> None:
        """Ask the box for these sensors alone: the others are 0 in the frames, which no sensor ever is."""
        self._asked = Event() if on_demand else None
        self.driver = self._driver(
            tuple(place for place, name in enumerate(self._wiring.sensor_names) if name in sensors)
        )

    def open(self) -> None:
        """Open the glove."""
        self.info = self.driver.open()

    def read(self, timeout_s: float) -> GloveFrame | None:
        """Return the next record that holds a measurement; on demand, the one that is asked for."""
        if self._asked is not None and not self._asked.wait(timeout_s):
            return None
        timed = self.driver.read(timeout_s)
        if timed is None:
            return None
        if self._asked is not None:
            self._asked.clear()
        time_us, record = timed
        self._unplugged = record.fault == "unplugged"
        return None if self._unplugged else GloveFrame(time_us, self._whole(record.sensors), record.status)

    def _whole(self, sensors: bytes) -> bytes:
        """Return a byte for every sensor of the glove, 0 for those that the record leaves out."""
        if self.info is None or len(sensors) == self.sensors:
            return sensors
        whole = bytearray(self.sensors)
        for place, byte in zip(self.info.places, sensors, strict=True):
            whole[place] = byte
        return bytes(whole)

    def ask(self) -> None:
        """Be asked for a record now, which is what it waits for on demand."""
        if self._asked is not None:
            self._asked.set()

    def counts(self) -> tuple[Count, ...]:
        """Return what the driver counts."""
        return counted(self.driver.counts)

    def trouble(self) -> str:
        """Return what is wrong though the line is open; "" if nothing is."""
        if self._unplugged or self.info is None:
            return "the glove is not plugged into its box" if self._unplugged else ""
        return self.info.unmasked

    def close(self) -> None:
        """Close the glove."""
        self.driver.close()


def glove_period_us(wiring: GloveWiring) -> int:
    """Return how often a CyberGlove so wired should send at least; the slowest that it can be where that is open.

    One that is asked for more than box and line can do sends as fast as they can.
    """
    baud = _SLOWEST_BAUD if wiring.baud == "auto" else wiring.baud
    shortest = round(shortest_us(wiring.all_sensors, baud, status=True, filtered=True))
    return max(SHORTEST_US, shortest, round(1e6 / wiring.rate_hz) if wiring.rate_hz else 0)


def _sources(harness: Harness, _names: Sequence[str], _scan: ScanMap) -> Iterator[Source]:
    if harness.cyberglove is not None:
        yield GloveDevice(harness.cyberglove)


def _periods_us(harness: Harness, _scan: ScanMap) -> Iterator[int]:
    if harness.cyberglove is not None:
        yield glove_period_us(harness.cyberglove)


MEMBER = SourceKind("cyberglove", "A CyberGlove on a serial line: [cyberglove].", "joints", _sources, _periods_us, 2)
