"""The CyberGlove of a harness."""

from collections.abc import Iterator, Sequence

from thenar.drivers.cyberglove import CyberGlove, GloveInfo
from thenar.drivers.cyberglove_protocol import shortest_us

from ..frames import PERIODS, GloveFrame
from ..harness.wiring import GloveWiring, Harness
from ..published import Count
from ..scanning.timing import glove_us
from .base import SHORTEST_US, Source, SourceKind, counted


class GloveDevice(Source):
    """A CyberGlove. A record of an unplugged glove is not a frame: it holds no measurement.

    info  the glove's description at the last opening
    """

    reads_joints = True

    def __init__(self, wiring: GloveWiring) -> None:
        self.name = f"cyberglove at {wiring.port}"
        self.sensors = wiring.all_sensors
        # A glove that cannot reach the requested rate sends as fast as box and line allow.
        shortest = round(shortest_us(wiring.all_sensors, wiring.baud, status=True, filtered=True))
        self.period_us = max(SHORTEST_US, shortest, round(1e6 / wiring.rate_hz) if wiring.rate_hz else 0)
        self.longest_us = PERIODS * self.period_us
        self._wiring, self._unplugged = wiring, False
        self.info: GloveInfo | None = None
        self.driver, self._read = self._driver(None), self.sensors

    def _driver(self, only: tuple[int, ...] | None) -> CyberGlove:
        wiring = self._wiring
        return CyberGlove(
            wiring.port,
            baud=wiring.baud,
            rate_hz=wiring.rate_hz,
            sensors=self.sensors,
            only=only,
            filtered=wiring.filter,
        )

    def read_only(self, sensors: Sequence[str]) -> None:
        """Request only these sensors from the box: the others are 0 in the frames, which no sensor value is."""
        places = tuple(place for place, name in enumerate(self._wiring.sensor_names) if name in sensors)
        self.driver, self._read = self._driver(places), len(places) or self.sensors

    @property
    def wire_us(self) -> float:
        """The time of a record, by the vendor's formula."""
        return glove_us(self._wiring, self._read)

    def open(self) -> None:
        """Open the glove."""
        self.info = self.driver.open()
        self.part, self.notes = self.info.text, self.info.notes

    def read(self, timeout_s: float) -> GloveFrame | None:
        """Return the next record that holds a measurement."""
        timed = self.driver.read(timeout_s)
        if timed is None:
            return None
        time_us, record = timed
        self._unplugged = record.fault == "unplugged"
        return None if self._unplugged else GloveFrame(time_us, self._whole(record.sensors), record.status)

    def _whole(self, sensors: bytes) -> bytes:
        """Return a byte for every sensor of the glove, 0 for those that the record omits."""
        if self.info is None or len(sensors) == self.sensors:
            return sensors
        whole = bytearray(self.sensors)
        for place, byte in zip(self.info.places, sensors, strict=True):
            whole[place] = byte
        return bytes(whole)

    def counts(self) -> tuple[Count, ...]:
        """Return the driver's counters."""
        return counted(self.driver.counts)

    def fault_message(self) -> str:
        """Return the fault of an open line; "" if there is none."""
        if self._unplugged or self.info is None:
            return "the glove is not plugged into its box" if self._unplugged else ""
        return self.info.unmasked

    def close(self) -> None:
        """Close the glove."""
        self.driver.close()


def _sources(harness: Harness, *_: object) -> Iterator[Source]:
    if harness.cyberglove is not None:
        yield GloveDevice(harness.cyberglove)


MEMBER = SourceKind("cyberglove", _sources, rank=2)
