"""Wirings of a glove, given or new, with port expanders at some clock or on a board; and the times of reading them."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import fsum

from msgspec.structs import replace

from thenar.drivers.cyberglove_protocol import SENSORS, sensors_with
from thenar.drivers.i2c import tca9548a
from thenar.drivers.i2c.chips import CHIPS, expanders
from thenar.drivers.spi.chips import SPI_CHIPS
from thenar.runtime.errors import HarnessError
from thenar.runtime.harness.wiring import GloveWiring, Harness
from thenar.runtime.scanning.plan import plan_scan, unwired
from thenar.runtime.scanning.scanmap import ScanMap
from thenar.runtime.scanning.timing import glove_us

from ..firmware.targets import TARGETS
from ..glove.propose import CONVERTER, propose_board, propose_cyberglove, propose_harness
from ..placement.ports import WireTimes
from .points import How, PointTime

AS_WIRED, BOARD = "as wired", "board"

# Standard mode, Fast mode, Fast-mode Plus.
CLOCKS_HZ = (100_000, 400_000, 1_000_000)
BAUDS = (115_200, 1_000_000)
# Chips that SPI0 of a Raspberry Pi selects.
_SELECTS = 2
# The clocks that an AVR's bus is run at.
_AVR_HZ = range(50_000, 400_001)
NO_TIME = PointTime(0.0, "wire")
# Overhead of one transfer on a Raspberry Pi. Doubtful: a kernel trace of a Pi 3 has 20 us from the call to the adapter
# and 6 us back; others measured 300 us (Pi Zero) with an older library.
PI_CALL_US = 30.0


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
    found = []
    if given is not None and (given.switches or given.taxel_names) and (not avr or _of_an_avr(given)):
        clocks_hz = [bus.clock_hz for bus in given.buses if bus.chips] or [chip.clock_hz for chip in given.spi]
        found.append(WiringOption(AS_WIRED, min(clocks_hz or [stream.baud for stream in given.streams]), given))
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


def _of_an_avr(given: Harness) -> bool:
    chips = [chip for bus in given.buses for chip in bus.chips]
    plain = all(chip.mux is None and chip.chip.registers and not chip.measures for chip in chips)
    return (
        plain and not given.streams and not given.spi and len(given.buses) == 1 and given.buses[0].clock_hz in _AVR_HZ
    )


@dataclass(frozen=True, slots=True)
class ReadingCost:
    """Microseconds of reading a number of things: a constant, and for each of them; no less than least_us.

    Of joints, it is the time of a record; of transactions, the overhead of each in addition to the wire.

    how   the source of these times: "formula" is the vendor's for a CyberGlove
    what  a sentence on them
    """

    fixed_us: float = 0.0
    each_us: float = 0.0
    least_us: float = 0.0
    how: How = "wire"
    what: str = ""

    def of(self, count: int) -> PointTime:
        """Return the time of reading this number of them."""
        return PointTime(max(self.fixed_us + count * self.each_us, self.least_us), self.how) if count else NO_TIME


NO_RECORDS = ReadingCost()
WIRE_ONLY = ReadingCost(what="scans are those of the wire alone")


def overhead_of(target: str) -> ReadingCost:
    """Return the overhead of transactions on `target` (a name of `frontier --target`)."""
    if target == "pi":
        return ReadingCost(
            each_us=PI_CALL_US,
            how="guess",
            what=f"a transfer on a Raspberry Pi is taken to have {PI_CALL_US:g} µs of overhead, which is a guess from "
            "a kernel trace of a Pi 3",
        )
    return ReadingCost(what=f"scans on {target} are those of the wire alone, without the time of its program")


@dataclass(frozen=True, slots=True)
class ScanTimes:
    """Time of reading the kept switches in one wiring, at this clock.

    us     microseconds of a scan; buses are read one after another, as `scan_us` of the runtime adds them up
    ports  transactions, where a stream's row is one; chips: those that are read
    how    "wire", or "guess" if a guess is included
    """

    wiring: str
    clock_hz: int
    us: float
    ports: int
    chips: int
    how: How


def scan_times(names: Sequence[str], wiring: WiringOption, overhead: ReadingCost = WIRE_ONLY) -> ScanTimes:
    """Return the scan times of a build's switches `names`, in its order.

    overhead is added to every transaction. Streams and buses work in parallel, so the slowest counts. Raises
    HarnessError if a switch has no place.
    """
    harness = wiring.harness_of(names)
    scan = plan_scan(names, harness)
    rows_us = [
        float(stream.period_us)
        for stream, read in zip(harness.streams, scan.streams, strict=True)
        if read.switches + read.levels
    ]
    return ScanTimes(
        wiring=wiring.name,
        clock_hz=wiring.clock_hz,
        us=max(_bus_us(scan, harness, overhead.each_us), *rows_us, 0.0),
        ports=len(scan.ports) + len(rows_us),
        chips=len({(port.bus, port.chip) for port in scan.ports}),
        how=overhead.how,
    )


def _bus_us(scan: ScanMap, harness: Harness, call_us: float) -> float:
    """Return the time of a scan of the chips, if there are any."""
    if not scan.ports:
        return 0.0
    times, read, us = WireTimes(scan.ports, harness), 0, list[float]()
    for number in range(len(scan.ports)):
        # Selecting a channel is a transaction as well.
        wire_ns = times.after(read, number)
        selected = wire_ns > times.after(read | 1 << number, number)
        us.append(wire_ns / 1000 + call_us * (1 + selected))
        read |= 1 << number
    return fsum(us)


def records_of(
    joints: Sequence[str],
    given_us: float | None = None,
    glove: GloveWiring | None = None,
    *,
    masked: bool = True,
) -> ReadingCost:
    """Return the time of reading some of the joints with these names.

    A CyberGlove, whose sensors may have other names if it is wired as `glove`, sends only the requested ones if its
    mask is set (`masked`), else all of its 18 or 22. Its time is by the vendor's formula (`glove_us`).
    `given_us` for all joints overrides that. The time of other joints is unknown.
    """
    if given_us is not None and joints:
        return ReadingCost(each_us=given_us / len(joints), how="given")
    named = () if glove is None else glove.joints
    sensors = len(named) if joints and set(joints) <= set(named) else sensors_with(joints)
    if sensors is None:
        return ReadingCost(how="unknown" if joints else "wire")
    wired = glove or GloveWiring(port="-", sensors=22 if sensors > SENSORS else None)
    fixed, more = (glove_us(replace(wired, rate_hz=None), count) for count in (0, 1))
    least = 0.0 if masked else fixed + sensors * (more - fixed)
    if wired.rate_hz:
        least = max(least, 1e6 / wired.rate_hz)
    return ReadingCost(fixed, more - fixed, least, "formula", _FORMULA)


_FORMULA = (
    "a CyberGlove's record is the vendor's formula, of a single source: each sensor is digitised in 250 µs "
    "(376 µs through the filter) before the record is sent; thenar doctor measures a connected glove"
)
