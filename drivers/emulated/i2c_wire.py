"""SDA and SCL: who answers at an address, what it costs in bytes and SCL periods, and what goes wrong on the way.

It needs the standard library alone: the system's own Python serves it to /dev/i2c-N.
"""

from collections import Counter
from dataclasses import dataclass, field

from ..i2c.chips.base import Device
from ..i2c.tca9548a import MuxModel

# Nine SCL periods a byte, one a START and one the STOP; then the bus is free for so long, by the clock's class.
BUS_FREE_US = ((100_000, 4.7), (400_000, 1.3), (1_000_000, 0.5))


class NakError(Exception):
    """Nobody acknowledged an address."""


@dataclass(frozen=True)
class Message:
    """What stands between two STARTs: `data` written, or `length` bytes read where data is None."""

    address: int
    data: bytes | None
    length: int = 0


@dataclass(eq=False)
class Station:
    """A chip in its place: straight on the bus, or on a channel of the mux at address `mux`."""

    model: type[Device]
    address: int
    mux: int | None = None
    channel: int | None = None
    absent: bool = False
    device: Device = field(init=False)

    def __post_init__(self) -> None:
        self.device = self.model()

    def become(self, model: type[Device]) -> None:
        """Put a new chip of another kind in the place; the pins stay wired."""
        levels, self.device = self.device.levels, model()
        self.device.levels = levels & (1 << self.device.pins) - 1


Place = tuple[int, int | None, int | None, int | None]  # address, mux, channel, register (where there are registers)


class Wire:
    """A bus with stations and muxes. `traffic` counts bytes by place and register, addresses included."""

    def __init__(self, stations: list[Station], clock_hz: int) -> None:
        self.stations = stations
        self.clock_hz = clock_hz
        self.muxes = {station.mux: MuxModel() for station in stations if station.mux is not None}
        self.absent_muxes: set[int] = set()
        self.sda_low = False
        self.traffic: Counter[Place] = Counter()
        self.scl_periods = self.transfers = 0

    def transfer(self, messages: list[Message]) -> list[bytes]:
        """Send messages, with a START before each and one STOP; return what was read, in order.

        Raises NakError. With SDA held low every address looks acknowledged and every byte reads 0.
        """
        self.transfers += 1
        commands: dict[Device, int] = {}
        try:
            return [self._send(message, commands) for message in messages]
        finally:
            self.scl_periods += 1
            for mux in self.muxes.values():
                mux.stop()

    def duration_s(self, scl_periods: int, transfers: int) -> float:
        """Return how long so many SCL periods in so many transfers take."""
        free_us = next((free for limit, free in BUS_FREE_US if self.clock_hz <= limit), BUS_FREE_US[-1][1])
        return scl_periods / self.clock_hz + transfers * free_us * 1e-6

    def _send(self, message: Message, commands: dict[Device, int]) -> bytes:
        self.scl_periods += 10
        if self.sda_low:
            self._count((message.address, None, None, None), 0 if message.data is None else len(message.data))
            return bytes(message.length)
        answering = self._answering(message.address)
        if not answering:
            self.traffic[(message.address, None, None, None)] += 1
            raise NakError(message.address)
        (device, mux, channel) = answering[0]
        if message.data and device.has_registers:
            commands[device] = message.data[0]
        size = message.length if message.data is None else len(message.data)
        self._count((message.address, mux, channel, commands.get(device)), size)
        return self._exchange(message, [device for device, _, _ in answering])

    def _exchange(self, message: Message, devices: list[Device]) -> bytes:
        if message.data is not None:
            for device in devices:
                device.write(message.data)
            return b""
        answer = bytes(b"\xff" * message.length)
        for device in devices:
            answer = bytes(a & b for a, b in zip(answer, device.read(message.length), strict=True))
        return answer

    def _count(self, place: Place, size: int) -> None:
        self.traffic[place] += 1 + size
        self.scl_periods += 9 * size

    def _answering(self, address: int) -> list[tuple[Device, int | None, int | None]]:
        found: list[tuple[Device, int | None, int | None]] = []
        if address in self.muxes and address not in self.absent_muxes:
            found.append((self.muxes[address], None, None))
        there = (s for s in self.stations if s.address == address and not s.absent and self._reached(s))
        found.extend((station.device, station.mux, station.channel) for station in there)
        return found

    def _reached(self, station: Station) -> bool:
        if station.mux is None or station.channel is None:
            return True
        return station.mux not in self.absent_muxes and bool(self.muxes[station.mux].connected >> station.channel & 1)
