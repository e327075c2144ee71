"""What a port expander and a converter are: to their bus, to the emulated bus, and as parts to solder.

It needs the standard library alone, as every chip's file does: the system's own Python emulates the chips.
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
    """One transaction that reads a port: `command` is written (nothing, where it is empty), then bytes are read.

    pins holds the chip's pin number for every bit of the answer, the lowest bit of the first byte first; -1 for none.
    high holds the bits of the answer that the chip itself keeps at 1 as long as it is set up.
    SCL periods are counted as datasheets draw them: nine a byte, one for a START or repeated START, one for the STOP.
    """

    name: str
    command: bytes
    pins: tuple[int, ...]
    high: int = 0

    @property
    def length(self) -> int:
        """Bytes of the answer."""
        return len(self.pins) // _BITS

    @property
    def wire_bytes(self) -> int:
        """Bytes on the wire, addresses included."""
        return (1 + len(self.command) if self.command else 0) + 1 + self.length

    @property
    def scl_periods(self) -> int:
        """SCL periods on the wire, from START to STOP."""
        return _BITS_A_BYTE * self.wire_bytes + (2 if self.command else 1) + 1


@dataclass(frozen=True, slots=True)
class Conversion(Reading):
    """One transaction that reads a channel of a converter, whose pin all bits of the answer are of; -1 for no bit.

    start  what is written to begin it, in a transfer of its own; empty where reading begins it
    us     how long after that the answer is there, at the latest; 0 where the wire takes longer
    """

    start: bytes = b""
    us: float = 0.0

    @property
    def start_periods(self) -> int:
        """SCL periods of the transfer that begins it."""
        return _BITS_A_BYTE * (1 + len(self.start)) + 2 if self.start else 0


@dataclass(frozen=True, slots=True)
class Write:
    """Bytes to write to a chip when it is set up; where `expect` is given, as many bytes read back must hold it.

    The first byte of `data` is the register, where the chip has registers, and the one read back. Only the bits of
    `mask` count; all of them, where it is empty.
    """

    data: bytes
    expect: bytes = b""
    mask: bytes = b""

    def holds(self, answer: bytes) -> bool:
        """Tell whether what was read back is what was expected."""
        masks = self.mask or b"\xff" * len(self.expect)
        return len(answer) == len(self.expect) and not any(
            (byte ^ wanted) & bits for byte, wanted, bits in zip(answer, self.expect, masks, strict=True)
        )


class Device(ABC):
    """Something with an address on an emulated bus, written from the data sheet and from nothing of its driver.

    Subclasses say how many pins they have, and whether registers. `levels` are the pins as the world drives them: bit p
    is pin p, 1 is high or open. A message is what lies between two STARTs; its address is not part of it.
    """

    pins: ClassVar[int]
    has_registers: ClassVar[bool] = True

    def __init__(self) -> None:
        self.levels = (1 << self.pins) - 1
        self.reset()

    @abstractmethod
    def reset(self) -> None:
        """Do as after power-on."""

    @abstractmethod
    def write(self, data: bytes) -> None:
        """Take the bytes of one message that writes."""

    @abstractmethod
    def read(self, length: int) -> bytes:
        """Return the bytes of one message that reads."""

    def poke(self, register: int, value: int) -> None:
        """Put `value` where nobody wrote it, as a crash of the last owner may have left it."""
        self.write(bytes((register, value)))

    def port(self, number: int) -> int:
        """Return the levels of eight pins."""
        return self.levels >> 8 * number & 0xFF


@dataclass(frozen=True, slots=True)
class Package:
    """A chip as a part to buy and to solder: part number, maker, KiCad's symbol and footprint.

    pins  the name of pin n of the data sheet's package at pins[n - 1], "NC" where there is nothing inside. Inputs are
          called as the driver calls them, and the others SDA, SCL, INT, RESET, A0, A1, A2 (or ADDR), on SPI CLK, DIN,
          DOUT, CS, and by the name of what is tied to the supply (VDD, VCC, VCCI, VCCP, REF, VREF) or to ground (VSS,
          GND, EP, COM, AGND, DGND).
    sure  whether part number, pins and footprint are each confirmed by two sources
    note  what is not, or what to heed
    straps    where one pin, ADDR, selects among more than two addresses: what it is tied to, from the lowest on
    library   KiCad's, of the symbol
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
        """Return the address pins, and what each is tied to for the address so far above the chip's lowest: "low",
        "high", "SDA" or "SCL".
        """
        if self.straps:
            return (("ADDR", self.straps[offset]),)
        names = [name for name in _SELECTS if name in self.pins]
        return tuple((name, "high" if offset >> bit & 1 else "low") for bit, name in enumerate(names))


class Chip(ABC):
    """A kind of port expander. Its file defines `MEMBER`, one instance, or a tuple of them.

    Whoever adds one supplies `setup` and these class attributes; nothing else in thenar names a chip.

    name        what glove.toml and the command line call it
    rank        its place in lists, and when an unknown chip is compared with what there is
    addresses   that its address pins can select, in ascending order
    clock_hz    the highest SCL
    pins        their names, in the order of their numbers
    not_inputs  names of pins that must not be inputs, and why
    readings    every transaction that reads some of its pins; of those that read the same, the cheapest first
    registers   False for a chip whose written bytes are the latch of its outputs: an input is a latch that was written
                high, so that switches must pull down; the generated firmware reads none of these
    pulls_up    whether its inputs are pulled up inside, by the chip itself or once it is set up; where they are not,
                the netlist has a resistor for each
    tried       whether a frontier tries a new glove with it: not where another chip's port is read as fast
    package     as a part to solder
    model       the class that emulates it, in a module that imports nothing but the standard library and thenar.drivers
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
    package: ClassVar[Package]
    model: ClassVar[type[Device]]

    @abstractmethod
    def setup(self, used: frozenset[int]) -> tuple[Write, ...]:
        """Return what makes inputs of the pins with the numbers `used`, with pull-ups where the chip has them.

        What is read back on the way tells the chip from every other that may have its address. What the last of them
        expects, if anything, is what a reset would lose: it is read again while the chip is in use.
        """

    def watched(self, used: frozenset[int]) -> Write | None:
        """Return what a reset of the chip would lose, if it would lose anything."""
        last = self.setup(used)[-1]
        return last if last.expect else None

    def check_address(self, address: int) -> None:
        """Raise SettingError if such a chip cannot have this address."""
        if address not in self.addresses:
            lowest, highest = min(self.addresses), max(self.addresses)
            raise SettingError(f"a {self.name} answers at 0x{lowest:02X} to 0x{highest:02X}, not at 0x{address:02X}")


class Converter(Chip):
    """A kind of analog-to-digital converter: its pins are the channels, its readings a `Conversion` of each, in order.

    bits   of a code; code 0 is 0 V
    volts  of the code 2 ** bits; None: of the supply, against which it measures
    """

    pulls_up = False
    tried = False
    bits: ClassVar[int]
    volts: ClassVar[float | None] = None
    readings: ClassVar[tuple[Conversion, ...]]

    @property
    def highest(self) -> int:
        """The code of the supply, 3.3 V, where a channel is saturated."""
        return (1 << self.bits) - 1 if self.volts is None else int(SUPPLY_V / self.volts * (1 << self.bits))

    def code(self, answer: bytes) -> int:
        """Return the code of an answer: high byte first, the unused bits on top."""
        return int.from_bytes(answer, "big") & (1 << self.bits) - 1


class ConverterModel(Device):
    """A converter on an emulated bus: `levels` holds the code at each channel, 16 bits each, the first lowest."""

    def __init__(self) -> None:
        super().__init__()
        self.levels = 0

    def at(self, channel: int) -> int:
        """Return the code at a channel."""
        return self.levels >> 16 * channel & 0xFFFF


def byte_pins(*ports: int) -> tuple[int, ...]:
    """Return the pin numbers of an answer that holds these ports of eight pins, in this order."""
    return tuple(_BITS * port + bit for port in ports for bit in range(_BITS))


def port_pins(*ports: int) -> tuple[str, ...]:
    """Return the names P00 to P07, P10 to P17 and so on of ports of eight pins, as most makers call them."""
    return tuple(f"P{port}{bit}" for port in ports for bit in range(_BITS))


def pins_of_24(ground: str, supply: str) -> tuple[str, ...]:
    """Return the pins of a package of 24, as every expander of 16 inputs has them, with the names of its supply."""
    return ("INT", "A1", "A2", *port_pins(0), ground, *port_pins(1), "A0", "SCL", "SDA", supply)
