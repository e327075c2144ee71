"""What an I2C port expander is to its bus: an address, pins with names, and the transactions that read them.

SCL periods are counted as datasheets draw them: nine a byte, one for a START or repeated START, one for the STOP.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from ..errors import SettingError

_BITS = 8


@dataclass(frozen=True, slots=True)
class Reading:
    """One transaction that reads a port: `command` is written (nothing, where it is empty), then bytes are read.

    pins holds the chip's pin number for every bit of the answer, the lowest bit of the first byte first; -1 for none.
    high holds the bits of the answer that the chip itself keeps at 1 as long as it is set up.
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
        return 9 * self.wire_bytes + (2 if self.command else 1) + 1


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


class Chip(ABC):
    """One port expander at an address.

    Subclasses say, as class attributes: kind (its name in glove.toml), addresses, clock_hz (the highest SCL), pins
    (their names in the order of their numbers), not_inputs (names of pins that must not be inputs, and why), readings
    (every transaction that reads some of its pins; the cheapest first), and registers (False for a chip whose written
    bytes are its outputs).
    """

    kind: ClassVar[str]
    addresses: ClassVar[Sequence[int]]
    clock_hz: ClassVar[int]
    pins: ClassVar[tuple[str, ...]]
    not_inputs: ClassVar[Mapping[str, str]] = {}
    readings: ClassVar[tuple[Reading, ...]]
    registers: ClassVar[bool] = True

    __slots__ = ("address",)

    def __init__(self, address: int) -> None:
        """Raise SettingError if such a chip cannot have this address."""
        if address not in self.addresses:
            lowest, highest = min(self.addresses), max(self.addresses)
            raise SettingError(f"a {self.kind} answers at 0x{lowest:02X} to 0x{highest:02X}, not at 0x{address:02X}")
        self.address = address

    @abstractmethod
    def setup(self, used: frozenset[int]) -> tuple[Write, ...]:
        """Return what makes inputs of the pins with the numbers `used`, with pull-ups where the chip has them.

        What is read back on the way tells the chip from every other that may have its address. What the last of them
        expects, if anything, is what a reset would lose: it is read again while the chip is in use.
        """


def byte_pins(*ports: int) -> tuple[int, ...]:
    """Return the pin numbers of an answer that holds these ports of eight pins, in this order."""
    return tuple(_BITS * port + bit for port in ports for bit in range(_BITS))
