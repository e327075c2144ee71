"""Wirings of a glove: the given one, or a new one, with port expanders at some clock or on a board."""

from collections.abc import Sequence
from dataclasses import dataclass

from msgspec.structs import replace

from thenar.drivers.i2c import tca9548a
from thenar.drivers.i2c.chips import CHIPS, expanders
from thenar.drivers.spi.chips import SPI_CHIPS
from thenar.runtime.errors import HarnessError
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.scanning.plan import unwired
from thenar.runtime.scanning.propose import CONVERTER, propose_board, propose_cyberglove, propose_harness

from ...firmware.targets import TARGETS

AS_WIRED, BOARD = "as wired", "board"

# Standard mode, Fast mode, Fast-mode Plus.
CLOCKS_HZ = (100_000, 400_000, 1_000_000)
BAUDS = (115_200, 1_000_000)
# Chips that SPI0 of a Raspberry Pi selects.
_SELECTS = 2
# The clocks that an AVR's bus is run at.
_AVR_HZ = range(50_000, 400_001)


@dataclass(frozen=True, slots=True)
class WiringOption:
    """A wiring of switches.

    name      "as wired" (the given harness), "board" (one that prints rows), or a kind of port expander or of converter
              for a new glove
    clock_hz  of the bus, of a converter's SPI, or baud of the board's line
    harness   the given one, for "as wired"
    muxes     whether chips may go behind a TCA9548A
    """

    name: str
    clock_hz: int
    harness: Harness | None = None
    muxes: bool = True

    def harness_of(self, names: Sequence[str], joints: Sequence[str] = ()) -> Harness:
        """Return the harness that reads the switches `names`, with a CyberGlove if `joints` are one's.

        The given harness is returned unchanged. Raises HarnessError if there is no room for the switches.
        """
        if self.harness is not None:
            return self.harness
        glove = propose_cyberglove(joints)
        if self.name == BOARD:
            return propose_board(names, baud=self.clock_hz, cyberglove=glove)
        proposed = propose_harness(names, self.name, cyberglove=glove)
        if self.name in SPI_CHIPS:
            if len(proposed.spi) > _SELECTS:
                raise HarnessError(f"{len(proposed.spi)} {self.name}, a Raspberry Pi's SPI selects {_SELECTS}")
            return replace(proposed, spi=tuple(replace(each, hz=self.clock_hz) for each in proposed.spi))
        self._check_muxes(proposed)
        return replace(proposed, buses=tuple(replace(bus, clock_hz=self.clock_hz) for bus in proposed.buses))

    def fits(self, names: Sequence[str]) -> bool:
        """Return whether there is a place for every one of these switches."""
        try:
            return not unwired(self.harness_of(names), names)
        except HarnessError:
            return False

    def _check_muxes(self, harness: Harness) -> None:
        measuring = [chip for bus in harness.buses for chip in bus.chips if chip.measures]
        if measuring and not self.muxes:
            raise HarnessError(f"taxels need a {measuring[0].kind}, which a board's sketch does not read")
        if measuring and self.clock_hz > measuring[0].chip.clock_hz:
            raise HarnessError(
                f"taxels need a {measuring[0].kind}, which runs at {measuring[0].chip.clock_hz} Hz at most"
            )
        if not any(chip.mux for bus in harness.buses for chip in bus.chips):
            return
        if not self.muxes:
            raise HarnessError(f"{self.name} chips need a TCA9548A here, whose channels a board's sketch cannot select")
        if self.clock_hz > tca9548a.CLOCK_HZ:
            raise HarnessError(
                f"{self.name} chips need a TCA9548A, which runs at {tca9548a.CLOCK_HZ} Hz at most: slow the bus down"
            )


def wirings(
    given: Harness | None, target: str = "host", *, switches: bool = True, taxels: bool = False
) -> tuple[WiringOption, ...]:
    """Return the candidate wirings for `target` (a name of `thenar frontier --target`): the given one, and those of a
    new glove with `switches` and `taxels`. Taxels are on ADS7828, or on one of the converters on SPI.

    An AVR reads its chips itself: without muxes, with registers, at 50 to 400 kHz. Other wirings, including boards that
    print rows, are not among its candidates.
    """
    avr = is_avr(target)
    found = (
        []
        if given is None or not (given.switches or given.taxel_names) or (avr and not _of_an_avr(given))
        else [_as_wired(given)]
    )
    for chip in expanders().values() if switches else (CHIPS[CONVERTER],) if taxels else ():
        if (chip.tried or not switches) and (chip.registers or not avr):
            clocks = (hz for hz in CLOCKS_HZ if hz <= chip.clock_hz and (not avr or hz in _AVR_HZ))
            found += [WiringOption(chip.name, hz, muxes=not avr) for hz in clocks]
    if taxels and not avr:
        most = max(len(chip.pins) for chip in SPI_CHIPS.values())
        found += [WiringOption(kind, chip.clock_hz) for kind, chip in SPI_CHIPS.items() if len(chip.pins) == most]
    return tuple(found if avr else [*found, *(WiringOption(BOARD, baud) for baud in BAUDS)])


def is_avr(target: str) -> bool:
    """Return whether `target` is an AVR, which reads the glove without a computer."""
    return target in TARGETS and TARGETS[target].avr


def _as_wired(given: Harness) -> WiringOption:
    clocks = [bus.clock_hz for bus in given.buses if bus.chips]
    lines = [chip.clock_hz for chip in given.spi] or [stream.baud for stream in given.streams]
    return WiringOption(AS_WIRED, min(clocks or lines), given)


def _of_an_avr(given: Harness) -> bool:
    chips = [chip for bus in given.buses for chip in bus.chips]
    plain = all(chip.mux is None and chip.chip.registers and not chip.measures for chip in chips)
    return (
        plain and not given.streams and not given.spi and len(given.buses) == 1 and given.buses[0].clock_hz in _AVR_HZ
    )
