"""The transactions that read a set of switches: the fewest per chip, and the shortest on the wire among those."""

from collections.abc import Collection, Mapping, Sequence
from itertools import combinations

from thenar.drivers.i2c.chips import Chip, Reading

from ..harness.wiring import ChipWiring, Harness, SpiWiring
from ..names import taxel_and_code
from .scanmap import SCHEMA, Pair, Port, ScanMap, StreamRead

# The levels of each taxel: (code, number of the switch) pairs, ascending.
Levels = Mapping[str, tuple[Pair, ...]]


def levels_of(harness: Harness, switch_names: Sequence[str]) -> Levels:
    """Return the names that are levels of the harness's taxels; a taxel's own name is its level above 0.

    The name of a switch is never a level, whatever it looks like.
    """
    taxels, pins = set(harness.taxel_names), set(harness.switches)
    found: dict[str, list[Pair]] = {}
    for number, name in enumerate(switch_names):
        taxel, code = (name, 0) if name in taxels else taxel_and_code(name) or ("", 0)
        if taxel in taxels and name not in pins:
            found.setdefault(taxel, []).append((code, number))
    return {taxel: tuple(sorted(levels)) for taxel, levels in found.items()}


def cover(chip: Chip, pins: Collection[int]) -> tuple[Reading, ...]:
    """Return the readings of `chip` that show all `pins`: the fewest, then those with the fewest SCL periods.

    Each shows a pin that none of the others shows. A reading of three ports may include an unused one in the middle
    (TCA6424A): one transaction of 57 SCL periods instead of two of 39.
    """
    wanted = set(pins)
    for count in range(len(chip.readings) + 1):
        enough = [some for some in combinations(chip.readings, count) if wanted <= _shown(some)]
        if enough:
            return min(enough, key=lambda some: sum(reading.scl_periods for reading in some))
    raise ValueError(f"a {chip.name} has no readings of its pins {sorted(wanted - _shown(chip.readings))}")


def ports_of(harness: Harness, numbers: Mapping[str, int], levels: Levels) -> tuple[Port, ...]:
    """Return the fewest ports whose replies hold all switches of `numbers` that are wired to chips, chip by chip, and
    the conversions of all taxels of `levels`.
    """
    ports = list[Port]()
    for bus, wire in enumerate(harness.wires):
        chips: tuple[ChipWiring | SpiWiring, ...] = wire.chips
        for number, wired in enumerate(chips):
            if isinstance(wired, SpiWiring) or wired.measures:
                ports += _conversions(bus, number, wired, levels)
            else:
                ports += _ports(bus, number, wired, numbers)
    return tuple(ports)


def _ports(bus: int, number: int, wired: ChipWiring, numbers: Mapping[str, int]) -> list[Port]:
    pins = {pin: numbers[name] for pin, name in wired.numbered_pins.items() if name in numbers}
    ports = []
    for reading in cover(wired.chip, pins):
        shown: tuple[Pair, ...] = tuple((bit, pins.pop(pin)) for bit, pin in enumerate(reading.pins) if pin in pins)
        ports.append(Port(bus, number, reading.name, shown, wired.closed == "high"))
    return ports


def _conversions(bus: int, number: int, wired: ChipWiring | SpiWiring, levels: Levels) -> list[Port]:
    """Return a port for each taxel with levels, if any: one conversion gives all its levels."""
    readings = wired.chip.readings
    return [
        Port(bus, number, readings[channel].name, (), True, levels[taxel])
        for channel, taxel in wired.numbered_pins.items()
        if taxel in levels
    ]


def _shown(readings: Collection[Reading]) -> set[int]:
    return {pin for reading in readings for pin in reading.pins}


def whole_scan(harness: Harness, switch_names: Sequence[str], *, every_taxel: bool = False) -> ScanMap:
    """Return the map that reads the switches and levels of these names, chip by chip with the fewest transactions.

    Names that are wired to nothing are not read. With `every_taxel`, taxels without levels are converted too, to record
    their codes, not for a build.
    """
    levels = levels_of(harness, switch_names)
    on_taxels = {number for pairs in levels.values() for _, number in pairs}
    numbers = {name: number for number, name in enumerate(switch_names) if number not in on_taxels}
    streams = tuple(
        StreamRead(
            tuple((place, numbers[name]) for place, name in enumerate(stream.switches) if name in numbers),
            tuple((place, *pair) for place, taxel in enumerate(stream.taxels) for pair in levels.get(taxel, ())),
        )
        for stream in harness.streams
    )
    if every_taxel:
        levels = {taxel: levels.get(taxel, ()) for taxel in harness.taxel_names}
    return ScanMap(SCHEMA, ports_of(harness, numbers, levels), streams)
