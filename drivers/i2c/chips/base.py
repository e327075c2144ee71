"""Port expanders and converters: their interface for the bus, their emulation, and their data as parts to solder.

This file and every chip's file need only the standard library: the system's Python emulates the chips.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from ...errors import SettingError

_BITS, _BITS_A_BYTE = 8, 9
SUPPLY = ("VDD", "VCC", "VCCI", "VCCP", "REF", "VREF")
GROUND = ("VSS", "GND", "EP", "COM", "AGND", "DGND")
RESET = "RESET"
TSSOP24 = "Package_SO:TSSOP-24_4.4x7.8mm_P0.65mm"
SUPPLY_V = 3.3
_SELECTS = ("A0", "A1", "A2", "ADDR")


@dataclass(frozen=True, slots=True)
class Reading:
    """One transaction that reads a port: `command` is written (unless it is empty), then bytes are read.

    pins  the chip's pin number for every bit of the reply, the lowest bit of the first byte first; -1 for none
    high  the bits of the reply that the chip keeps at 1 while it is set up

    SCL periods follow the datasheets: nine a byte, one for a START or repeated START, one for the STOP.
    """

    name: str
    command: bytes
    pins: tuple[int, ...]
    high: int = 0

    @property
    def length(self) -> int:
        """Bytes of the reply."""
        return len(self.pins) // _BITS

    @property
    def wire_bytes(self) -> int:
        """Bytes on the wire, including addresses."""
        return (1 + len(self.command) if self.command else 0) + 1 + self.length

    @property
    def scl_periods(self) -> int:
        """SCL periods on the wire, from START to STOP."""
        return _BITS_A_BYTE * self.wire_bytes + (2 if self.command else 1) + 1


@dataclass(frozen=True, slots=True)
class Conversion(Reading):
    """One transaction that reads a converter channel: `pins` holds its pin for each bit of the reply; -1 for none.

    start  bytes written in a separate transfer to start it; empty if reading starts it
    us     the longest time from then to the result; 0 if the transfer takes longer
    """

    start: bytes = b""
    us: float = 0.0

    @property
    def start_periods(self) -> int:
        """SCL periods of the transfer that starts it."""
        return _BITS_A_BYTE * (1 + len(self.start)) + 2 if self.start else 0


@dataclass(frozen=True, slots=True)
class Write:
    """Bytes to write to a chip at set-up. If `expect` is given, as many bytes are read back and must match it.

    If the chip has registers, the first byte of `data` is the register, which is also the one read back. Only the bits
    of `mask` count, or all if it is empty.
    """

    data: bytes
    expect: bytes = b""
    mask: bytes = b""

    def holds(self, reply: bytes) -> bool:
        """Return whether the bytes read back match the expected ones."""
        masks = self.mask or b"\xff" * len(self.expect)
        return len(reply) == len(self.expect) and not any(
            (byte ^ wanted) & bits for byte, wanted, bits in zip(reply, self.expect, masks, strict=True)
        )


class Device(ABC):
    """A device with an address on an emulated bus, written from the data sheet, independently of its driver.

    Subclasses define the number of pins, and whether there are registers. `levels` are the externally driven levels of
    the pins: bit p is pin p, 1 is high or open. A message is the bytes between two STARTs, without the address.
    """

    pins: ClassVar[int]
    has_registers: ClassVar[bool] = True

    def __init__(self) -> None:
        self.levels = (1 << self.pins) - 1
        self.reset()

    @abstractmethod
    def reset(self) -> None:
        """Reset to the state after power-on."""

    @abstractmethod
    def write(self, data: bytes) -> None:
        """Process the bytes of one write message."""

    @abstractmethod
    def read(self, length: int) -> bytes:
        """Return the bytes of one read message."""

    def poke(self, register: int, value: int) -> None:
        """Set a register to `value` without a bus write, as a crash of the last owner may have left it."""
        self.write(bytes((register, value)))

    def port(self, number: int) -> int:
        """Return the levels of eight pins."""
        return self.levels >> 8 * number & 0xFF


class RegisterModel(Device):
    """A device with registers of a byte each, behind a pointer that the first byte of a write message sets, and that
    moves on with every other byte.
    """

    def write(self, data: bytes) -> None:
        """Process the bytes of one write message."""
        if data:
            self._point(data[0])
        for byte in data[1:]:
            self._store(byte)
            self._advance()

    def read(self, length: int) -> bytes:
        """Return the bytes of one read message."""
        reply = bytearray()
        for _ in range(length):
            reply.append(self._load())
            self._advance()
        return bytes(reply)

    @abstractmethod
    def _point(self, byte: int) -> None: ...

    @abstractmethod
    def _store(self, byte: int) -> None: ...

    @abstractmethod
    def _load(self) -> int: ...

    @abstractmethod
    def _advance(self) -> None: ...


@dataclass(frozen=True, slots=True)
class ChipPackage:
    """A chip as a part to buy and to solder: part number, maker, KiCad's symbol and footprint.

    pins  the name of pin n of the data sheet's package at pins[n - 1], "NC" if unconnected. Inputs have the driver's
          names; the others are SDA, SCL, INT, RESET, A0, A1, A2 (or ADDR), on SPI CLK, DIN, DOUT, CS, and the names of
          pins tied to the supply (VDD, VCC, VCCI, VCCP, REF, VREF) or to ground (VSS, GND, EP, COM, AGND, DGND)
    sure  whether part number, pins and footprint are each confirmed by two sources
    note  unconfirmed data, or advice
    straps    if one pin, ADDR, selects among more than two addresses: its connections, in order of the addresses
    library   KiCad's library of the symbol
    """

    part: str
    maker: str
    symbol: str
    footprint: str
    pins: tuple[str, ...]
    sure: bool = True
    note: str = ""
    straps: tuple[str, ...] = ()
    library: str = "Interface_Expansion"

    def number(self, name: str) -> str:
        """Return the number of the pin called `name`."""
        return str(self.pins.index(name) + 1)

    def selects(self, offset: int) -> tuple[tuple[str, str], ...]:
        """Return each address pin and its connection ("low", "high", "SDA" or "SCL") for an address.

        offset  of the address from the chip's lowest
        """
        if self.straps:
            return (("ADDR", self.straps[offset]),)
        names = [name for name in _SELECTS if name in self.pins]
        return tuple((name, "high" if offset >> bit & 1 else "low") for bit, name in enumerate(names))


class Chip(ABC):
    """A kind of port expander. Its file defines `MEMBER`, one instance, or a tuple of them.

    A new chip supplies `setup` and these class attributes; no other code in thenar names a chip.

    name        its name in glove.toml and on the command line
    rank        its place in lists, and in the identification of an unknown chip
    addresses   that its address pins can select, in ascending order
    clock_hz    the highest SCL
    pins        names of its pins, in the order of their numbers
    not_inputs  names of pins that must not be inputs, and why
    readings    every transaction that reads some of its pins; of equivalent ones, the cheapest first
    registers   False for a chip whose written bytes are the latch of its outputs: an input is a latch written high, so
                switches must pull down; the generated firmware does not read such chips
    pulls_up    whether the chip pulls up its inputs, always or once it is set up; if not, the netlist has a resistor
                for each
    tried       whether a frontier considers it for a new glove: not if another chip's port is read as fast
    package     its data as a part to solder
    model       the class that emulates it, in a module that imports only the standard library and thenar.drivers
    """

    name: ClassVar[str]
    rank: ClassVar[int] = 0
    addresses: ClassVar[Sequence[int]]
    clock_hz: ClassVar[int]
    pins: ClassVar[tuple[str, ...]]
    not_inputs: ClassVar[Mapping[str, str]] = {}
    readings: ClassVar[tuple[Reading, ...]]
    registers: ClassVar[bool] = True
    pulls_up: ClassVar[bool] = True
    tried: ClassVar[bool] = True
    package: ClassVar[ChipPackage]
    model: ClassVar[type[Device]]

    @abstractmethod
    def setup(self, used: frozenset[int]) -> tuple[Write, ...]:
        """Return the writes that make the pins with the numbers `used` inputs, with pull-ups if the chip has them.

        The bytes read back distinguish the chip from every other that may have its address. The value that the last
        write expects, if any, would be lost at a reset: it is read again while the chip is in use.
        """

    def watched(self, used: frozenset[int]) -> Write | None:
        """Return the write that a reset of the chip would lose, if any."""
        last = self.setup(used)[-1]
        return last if last.expect else None

    def check_address(self, address: int) -> None:
        """Raise SettingError if such a chip cannot have this address."""
        if address not in self.addresses:
            lowest, highest = min(self.addresses), max(self.addresses)
            raise SettingError(f"a {self.name} is at 0x{lowest:02X} to 0x{highest:02X}, not at 0x{address:02X}")


class Converter(Chip):
    """A kind of analog-to-digital converter: its pins are the channels, its readings a `Conversion` of each, in order.

    bits   of a code; code 0 is 0 V
    volts  at the code 2 ** bits; None: the supply voltage
    """

    pulls_up = False
    tried = False
    bits: ClassVar[int]
    volts: ClassVar[float | None] = None
    readings: ClassVar[tuple[Conversion, ...]]

    @property
    def highest(self) -> int:
        """The code of the supply, 3.3 V, at which a channel is saturated."""
        return (1 << self.bits) - 1 if self.volts is None else int(SUPPLY_V / self.volts * (1 << self.bits))

    def code(self, reply: bytes) -> int:
        """Return the code of a reply: high byte first, the unused bits on top."""
        return int.from_bytes(reply, "big") & (1 << self.bits) - 1


class ConverterModel(Device):
    """A converter on an emulated bus: `levels` holds the code at each channel, 16 bits each, the first lowest."""

    def __init__(self) -> None:
        super().__init__()
        self.levels = 0

    def at(self, channel: int) -> int:
        """Return the code at a channel."""
        return self.levels >> 16 * channel & 0xFFFF


def byte_pins(*ports: int) -> tuple[int, ...]:
    """Return the pin numbers of a reply that holds these ports of eight pins, in this order."""
    return tuple(_BITS * port + bit for port in ports for bit in range(_BITS))


def port_pins(*ports: int) -> tuple[str, ...]:
    """Return the names P00 to P07, P10 to P17 and so on of ports of eight pins, as most makers call them."""
    return tuple(f"P{port}{bit}" for port in ports for bit in range(_BITS))


def pins_of_24(ground: str, supply: str) -> tuple[str, ...]:
    """Return the pins of a 24-pin package, common to all expanders of 16 inputs, with the names of its supply pins."""
    return ("INT", "A1", "A2", *port_pins(0), ground, *port_pins(1), "A0", "SCL", "SDA", supply)
