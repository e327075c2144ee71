"""SDA and SCL: replies at an address, their cost in bytes and SCL periods, faults; and the limits and errnos of the
kernel's adapter drivers.

Read from the kernel's sources: i2c-bcm2835 (Raspberry Pi 0 to 4), i2c-designware-master (Raspberry Pi 5, many PCs),
i2c-algo-bit (i2c-gpio); "any" has no limits.

It needs only the standard library: the system's Python serves it to /dev/i2c-N.
"""

import errno
from collections import Counter
from dataclasses import dataclass, field
from typing import NamedTuple

from ..i2c.chips.base import Device
from ..i2c.node import MOST_MESSAGES
from ..i2c.tca9548a import MuxModel

# Nine SCL periods a byte, one a START and one the STOP; then the bus free time, by speed class.
BUS_FREE_US = ((100_000, 4.7), (400_000, 1.3), (1_000_000, 0.5))


class NakError(Exception):
    """No device acknowledged an address."""


@dataclass(frozen=True)
class Message:
    """The message between two STARTs: `data` written, or `length` bytes read if data is None."""

    address: int
    data: bytes | None
    length: int = 0


@dataclass(eq=False)
class Station:
    """A chip and its location: directly on the bus or on a channel of the mux at address `mux`."""

    model: type[Device]
    address: int
    mux: int | None = None
    channel: int | None = None
    absent: bool = False
    device: Device = field(init=False)

    def __post_init__(self) -> None:
        self.device = self.model()

    def become(self, model: type[Device]) -> None:
        """Replace the chip by a new one of another kind; the pins stay wired."""
        levels, self.device = self.device.levels, model()
        self.device.levels = levels & (1 << self.device.pins) - 1


class Place(NamedTuple):
    """Where bytes go to and come from; `register` if the chip has registers."""

    address: int
    mux: int | None = None
    channel: int | None = None
    register: int | None = None


class Wire:
    """A bus with stations and muxes. `traffic` counts bytes by place and register, including addresses."""

    def __init__(self, stations: list[Station], clock_hz: int) -> None:
        self.stations = stations
        self.clock_hz = clock_hz
        self.muxes = {station.mux: MuxModel() for station in stations if station.mux is not None}
        self.absent_muxes: set[int] = set()
        self.sda_low = False
        self.traffic: Counter[Place] = Counter()
        self.scl_periods = self.transfers = 0

    def transfer(self, messages: list[Message]) -> list[bytes]:
        """Send messages, with a START before each and one STOP; return the bytes read, in order.

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
        """Return the duration of `scl_periods` in `transfers`."""
        free_us = next((free for limit, free in BUS_FREE_US if self.clock_hz <= limit), BUS_FREE_US[-1][1])
        return scl_periods / self.clock_hz + transfers * free_us * 1e-6

    def _send(self, message: Message, commands: dict[Device, int]) -> bytes:
        self.scl_periods += 10
        if self.sda_low:
            self._count(Place(message.address), 0 if message.data is None else len(message.data))
            return bytes(message.length)
        responding = self._responding(message.address)
        if not responding:
            self.traffic[Place(message.address)] += 1
            raise NakError(message.address)
        (device, mux, channel) = responding[0]
        if message.data and device.has_registers:
            commands[device] = message.data[0]
        size = message.length if message.data is None else len(message.data)
        self._count(Place(message.address, mux, channel, commands.get(device)), size)
        if message.data is not None:
            for device, _, _ in responding:
                device.write(message.data)
            return b""
        reply = b"\xff" * message.length
        for device, _, _ in responding:
            reply = bytes(a & b for a, b in zip(reply, device.read(message.length), strict=True))
        return reply

    def _count(self, place: Place, size: int) -> None:
        self.traffic[place] += 1 + size
        self.scl_periods += 9 * size

    def _responding(self, address: int) -> list[tuple[Device, int | None, int | None]]:
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


# The error codes of each adapter: errno of a NAK; errno with SDA held low (None: not detected).
ADAPTERS: dict[str, tuple[int, int | None]] = {
    "bcm2835": (errno.EREMOTEIO, errno.ETIMEDOUT),
    "designware": (errno.EREMOTEIO, errno.EAGAIN),
    "i2c-gpio": (errno.ENXIO, None),
    "any": (errno.EREMOTEIO, errno.EBUSY),
}


@dataclass
class TransferFault:
    """A fault that makes transfers to `address` (None: all) fail with errno `code`, `times` times (None: until healed).

    `batches`: only transfers of more than one write and read.
    """

    code: int
    address: int | None = None
    times: int | None = None
    batches: bool = False

    def hits(self, messages: list[Message]) -> bool:
        """Return whether these messages fail, and count it."""
        met = self.address is None or any(message.address == self.address for message in messages)
        if not met or self.times == 0 or (self.batches and len(messages) <= 2):
            return False
        if self.times is not None:
            self.times -= 1
        return True


class Adapter:
    """One bus as the kernel presents it: every error is an OSError with the errno of this adapter.

    Its faults are injected from outside; a chip is its number on the bus.
    """

    def __init__(self, wire: Wire, kind: str) -> None:
        self.wire = wire
        self.kind = kind
        self.nak_errno, self.stuck_errno = ADAPTERS[kind]
        self.faults: list[TransferFault] = []
        self.claimed: set[int] = set()
        self.stuck_for: int | None = None
        self.calls = 0

    def slave(self, address: int) -> None:
        """I2C_SLAVE: EBUSY if a kernel driver holds the address."""
        if address in self.claimed:
            raise OSError(errno.EBUSY, "claimed")

    def fail(self, code: int, *, address: int | None = None, times: int | None = None, batches: bool = False) -> None:
        """Make transfers fail: see `TransferFault`."""
        self.faults.append(TransferFault(code, address, times, batches))

    def remove(self, chip: int) -> None:
        """Make a chip stop acknowledging; `heal` restores it with its state."""
        self.wire.stations[chip].absent = True

    def remove_mux(self, mux: int) -> None:
        """Make a mux and the chips behind it stop acknowledging."""
        self.wire.absent_muxes.add(mux)

    def reset(self, chip: int) -> None:
        """Reset a chip to its defaults, as a power glitch does."""
        self.wire.stations[chip].device.reset()

    def poke(self, chip: int, register: int, value: int) -> None:
        """Write a register behind the client's back."""
        self.wire.stations[chip].device.poke(register, value)

    def poke_mux(self, mux: int, control: int) -> None:
        """Change a mux's control register; 0 is the effect of a reset."""
        self.wire.muxes[mux].write(bytes((control,)))
        self.wire.muxes[mux].stop()

    def claim(self, address: int) -> None:
        """Make a kernel driver hold an address: I2C_SLAVE fails with EBUSY."""
        self.claimed.add(address)

    def hold_sda(self, transfers: int | None = None) -> None:
        """Hold SDA low until healed, or until this number of transfers has clocked it free."""
        self.stuck_for, self.wire.sda_low = transfers, True

    def heal(self) -> None:
        """End all persistent faults."""
        self.faults.clear()
        self.claimed.clear()
        self.stuck_for, self.wire.sda_low = None, False
        self.wire.absent_muxes.clear()
        for station in self.wire.stations:
            station.absent = False

    def rdwr(self, messages: list[Message]) -> list[bytes]:
        """I2C_RDWR: send all messages in one transfer."""
        if len(messages) > MOST_MESSAGES:
            raise OSError(errno.EINVAL, "too many messages")
        if self.kind == "bcm2835" and any(message.data is None for message in messages[:-1]):
            raise OSError(errno.EOPNOTSUPP, "one read, and it must be the last")
        if self.kind == "designware" and len({message.address for message in messages}) > 1:
            raise OSError(errno.EINVAL, "one address a transfer")
        for fault in self.faults:
            if fault.hits(messages):
                raise OSError(fault.code, "injected")
        if self.wire.sda_low:
            self._clock_out()
        try:
            return self.wire.transfer(messages)
        except NakError:
            raise OSError(self.nak_errno, "NAK") from None

    def _clock_out(self) -> None:
        if self.stuck_for is not None:
            self.stuck_for -= 1
            self.wire.sda_low = self.stuck_for > 0
        if self.wire.sda_low and self.stuck_errno is not None:
            raise OSError(self.stuck_errno, "SDA is low")
