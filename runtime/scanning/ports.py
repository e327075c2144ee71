"""Which transactions read a set of switches: of each chip the fewest, and of as few the shortest on the wire."""

from collections.abc import Collection, Mapping, Sequence
from itertools import combinations

from thenar.drivers.i2c.chips import Chip, Reading

from ..harness.wiring import ChipWiring, Harness
from .scanmap import SCHEMA, Pair, Port, ScanMap


def cover(chip: Chip, pins: Collection[int]) -> tuple[Reading, ...]:
    """Return the readings of `chip` that show all `pins`: the fewest, then those of the fewest SCL periods.

    Each shows a pin that no other of them shows. A reading of three ports may pass over an unused one in the middle
    (TCA6424A): one transaction of 57 SCL periods instead of two of 39.
    """
    wanted = set(pins)
    for count in range(len(chip.readings) + 1):
        enough = [some for some in combinations(chip.readings, count) if wanted <= _shown(some)]
        if enough:
            return min(enough, key=lambda some: sum(reading.scl_periods for reading in some))
    raise ValueError(f"a {chip.name} has no readings of its pins {sorted(wanted - _shown(chip.readings))}")


def ports_of(harness: Harness, numbers: Mapping[str, int]) -> tuple[Port, ...]:
    """Return the fewest ports whose answers hold all switches of `numbers` that hang on chips, chip by chip."""
    return tuple(
        port
        for bus, wiring in enumerate(harness.buses)
        for chip, wired in enumerate(wiring.chips)
        for port in _ports(bus, chip, wired, numbers)
    )


def _ports(bus: int, number: int, wired: ChipWiring, numbers: Mapping[str, int]) -> list[Port]:
    left = {pin: numbers[name] for pin, name in wired.numbered_pins.items() if name in numbers}
    ports = []
    for reading in cover(wired.chip, left):
        shown: tuple[Pair, ...] = tuple((bit, left.pop(pin)) for bit, pin in enumerate(reading.pins) if pin in left)
        ports.append(Port(bus, number, reading.name, shown, wired.closed == "high"))
    return ports


def _shown(readings: Collection[Reading]) -> set[int]:
    return {pin for reading in readings for pin in reading.pins}


def whole_scan(harness: Harness, switch_names: Sequence[str]) -> ScanMap:
    """Return the map that reads the switches of these names, chip by chip with the fewest transactions.

    Names that are wired to nothing are read by nobody.
    """
    numbers = {name: number for number, name in enumerate(switch_names)}
    scanners = tuple(
        tuple((key, numbers[name]) for key, name in enumerate(scanner.switches) if name in numbers)
        for scanner in harness.scanners
    )
    return ScanMap(SCHEMA, harness.fingerprint, ports_of(harness, numbers), scanners)
