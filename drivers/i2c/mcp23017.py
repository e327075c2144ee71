"""Microchip MCP23017: two ports of eight pins, of which seven each may be inputs (DS20001952, BANK = 0)."""

from .chip import Chip, Reading, Write, byte_pins

_IODIRA, _IOCON, _GPIOA, _GPIOB = 0x00, 0x0A, 0x12, 0x13
_IOCON_OF_BANK_1 = 0x05

# Open-drain INT pins, which nothing here uses: a value that no reset leaves, and that harms nobody on a shared line.
OPEN_DRAIN = 0x04

NOT_AN_INPUT = (
    "since revision D of its data sheet (2022) it is an output only: a level that changes during a read can corrupt SDA"
)


class Mcp23017(Chip):
    """Sixteen pins: GPA0 to GPA7, GPB0 to GPB7. SCL up to 1.7 MHz at 4.5 V, 400 kHz at 2.7 V, 100 kHz at 1.8 V."""

    kind = "mcp23017"
    addresses = range(0x20, 0x28)
    clock_hz = 1_700_000
    pins = tuple(f"GP{port}{bit}" for port in "AB" for bit in range(8))
    not_inputs = {"GPA7": NOT_AN_INPUT, "GPB7": NOT_AN_INPUT}  # noqa: RUF012
    readings = (
        Reading("A", bytes((_GPIOA,)), byte_pins(0), high=0x80),
        Reading("B", bytes((_GPIOB,)), byte_pins(1), high=0x80),
        Reading("AB", bytes((_GPIOA,)), byte_pins(0, 1), high=0x8080),
    )

    __slots__ = ()

    def setup(self, used: frozenset[int]) -> tuple[Write, ...]:
        """Return the writes that lead from any state, BANK = 1 included, to inputs with pull-ups on the used pins.

        A crash may have left BANK = 1, where 05 is IOCON; in BANK = 0 it is GPINTENB, to be 0 anyway. GPA7 and GPB7
        are pulled up too: a pin that must not change its level must not float; and as nothing hangs on them, a 0 there
        tells in every answer that the pull-ups are gone.
        """
        pulled = sum(1 << pin for pin in used | {7, 15}).to_bytes(2, "little")
        control = bytes((OPEN_DRAIN, OPEN_DRAIN))
        unmasked = b"\xff\xff" + bytes(4)  # IODIR all inputs, IPOL as read, GPINTEN off
        return (
            Write(bytes((_IOCON_OF_BANK_1, 0))),
            Write(bytes((_IOCON, OPEN_DRAIN)), control),  # one register at two addresses: only this chip has that
            Write(bytes((_IODIRA,)) + unmasked, unmasked),
            Write(bytes((_IOCON,)) + control + pulled, control + pulled),  # GPPU follows IOCON
        )
