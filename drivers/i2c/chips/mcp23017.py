"""Microchip MCP23017: two ports of eight pins, of which seven each may be inputs (DS20001952, BANK = 0)."""

from .base import Chip, ChipPackage, Reading, RegisterModel, Write, byte_pins

_IODIRA, _IOCON, _GPIOA, _GPIOB = 0x00, 0x0A, 0x12, 0x13
_IOCON_OF_BANK_1 = 0x05

# Open-drain INT pins, unused here: a value that no reset leaves, and that is harmless on a shared line.
OPEN_DRAIN = 0x04

NOT_AN_INPUT = (
    "since revision D of its data sheet (2022) it is only an output: a level that changes during a read can corrupt SDA"
)


class Mcp230xxModel(RegisterModel):
    """Registers with an automatically incremented pointer; pins without pull-up float, and read 0 here.

    It is an MCP23008, with one port, and registers 00 to 0A.
    """

    pins = 8
    _INPUTS, _POLARITY, _CONTROL, _PULL_UPS, _FLAGS, _CAPTURE, _PINS, _LATCH = 0, 1, 5, 6, 7, 8, 9, 10
    _REGISTERS = 11

    def reset(self) -> None:
        """Reset to the state after power-on."""
        self._values = [[0] * self._REGISTERS for _ in range(self.pins // 8)]
        for values in self._values:
            values[self._INPUTS] = 0xFF
        self._pointer = 0

    def _point(self, byte: int) -> None:
        self._pointer = byte & 0x1F

    def _decode(self, address: int) -> tuple[int, int]:
        """Return port and register; an invalid register for an unused address."""
        return 0, address

    def _advance(self) -> None:
        if not self._values[0][self._CONTROL] & 0x20:
            self._pointer = (self._pointer + 1) % self._REGISTERS

    def _store(self, byte: int) -> None:
        port, register = self._decode(self._pointer)
        if register == self._CONTROL:
            for values in self._values:
                values[register] = byte
        elif register == self._PINS:
            self._values[port][self._LATCH] = byte
        elif register < self._REGISTERS and register not in (self._FLAGS, self._CAPTURE):
            self._values[port][register] = byte

    def _load(self) -> int:
        port, register = self._decode(self._pointer)
        if register >= self._REGISTERS:
            return 0
        values = self._values[port]
        if register != self._PINS:
            return values[register]
        inputs = values[self._INPUTS]
        seen = self.port(port) & values[self._PULL_UPS] ^ values[self._POLARITY]
        return seen & inputs | values[self._LATCH] & ~inputs


class Mcp23017Model(Mcp230xxModel):
    """Two ports; BANK (bit 7 of IOCON) says whether their registers alternate or follow each other."""

    pins = 16

    def _bank(self) -> int:
        return self._values[0][self._CONTROL] >> 7

    def _decode(self, address: int) -> tuple[int, int]:
        return (address >> 4, address & 0xF) if self._bank() else (address & 1, address >> 1)

    def _advance(self) -> None:
        still = self._values[0][self._CONTROL] & 0x20
        if self._bank():
            self._pointer = self._pointer if still else (self._pointer + 1) % 0x1B
        else:
            self._pointer = self._pointer ^ 1 if still else (self._pointer + 1) % 0x16


class Mcp23017(Chip):
    """Sixteen pins: GPA0 to GPA7, GPB0 to GPB7. SCL up to 1.7 MHz at 4.5 V, 400 kHz at 2.7 V, 100 kHz at 1.8 V."""

    name = "mcp23017"
    rank = 1
    addresses = range(0x20, 0x28)
    clock_hz = 1_700_000
    pins = tuple(f"GP{port}{bit}" for port in "AB" for bit in range(8))
    not_inputs = {"GPA7": NOT_AN_INPUT, "GPB7": NOT_AN_INPUT}  # noqa: RUF012
    readings = (
        Reading("A", bytes((_GPIOA,)), byte_pins(0), high=0x80),
        Reading("B", bytes((_GPIOB,)), byte_pins(1), high=0x80),
        Reading("AB", bytes((_GPIOA,)), byte_pins(0, 1), high=0x8080),
    )
    model = Mcp23017Model
    package = ChipPackage(
        part="MCP23017-E/SO",
        maker="Microchip",
        symbol="MCP23017_SO",
        footprint="Package_SO:SOIC-28W_7.5x17.9mm_P1.27mm",
        pins=(
            *(f"GPB{bit}" for bit in range(8)),
            *("VDD", "VSS", "NC", "SCL", "SDA", "NC", "A0", "A1", "A2", "RESET", "INTB", "INTA"),
            *(f"GPA{bit}" for bit in range(8)),
        ),
        note="GPA7 and GPB7 stay unconnected: since 2022 they are only outputs",
    )

    def setup(self, used: frozenset[int]) -> tuple[Write, ...]:
        """Return the writes that lead from any state, including BANK = 1, to inputs with pull-ups on the used pins.

        A crash may have left BANK = 1, where 05 is IOCON; in BANK = 0 it is GPINTENB, to be 0 anyway. GPA7 and GPB7
        are pulled up too, because a pin that must not change its level must not float. They are unconnected, so a 0
        there shows in every reply that the pull-ups are gone.
        """
        pulled = sum(1 << pin for pin in used | {7, 15}).to_bytes(2, "little")
        control = bytes((OPEN_DRAIN, OPEN_DRAIN))
        unmasked = b"\xff\xff" + bytes(4)  # IODIR all inputs, IPOL as read, GPINTEN off
        return (
            Write(bytes((_IOCON_OF_BANK_1, 0))),
            Write(bytes((_IOCON, OPEN_DRAIN)), control),  # one register at two addresses, which is unique to this chip
            Write(bytes((_IODIRA,)) + unmasked, unmasked),
            Write(bytes((_IOCON,)) + control + pulled, control + pulled),  # GPPU follows IOCON
        )


MEMBER = Mcp23017()
