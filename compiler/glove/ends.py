"""Where the wires of the kept switches end: at a pin of an expander, or at a key of a scanner board."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from msgspec.structs import replace

from thenar.runtime.harness.wiring import BusWiring, ChipWiring, Harness

GROUND, SUPPLY = "GND", "VCC"


@dataclass(frozen=True, slots=True)
class BoardPins:
    """How a scanner board reaches its keys, as its `board.toml` says: key k is read at the pin signals[k].

    lows[k] is the pin that is driven low to read it, the row of a matrix; "" where the switch goes to ground. With
    `diodes` there is one to every switch, its cathode towards the row. A board that reads its keys from expanders has
    their `bus` instead.
    """

    signals: tuple[str, ...] = ()
    lows: tuple[str, ...] = ()
    diodes: bool = False
    bus: BusWiring | None = None


@dataclass(frozen=True, slots=True)
class Unit:
    """What reads switches: an expander at buses[bus].chips[chip] of a harness, or, without `wiring`, a scanner board.

    ref is its designator in the netlist; place, how messages and tables call it.
    """

    ref: str
    place: str
    bus: int = 0
    wiring: ChipWiring | None = None
    diodes: bool = False


@dataclass(frozen=True, slots=True)
class End:
    """Where a switch, by its number in the build, ends: pin is a name, pad the number that the netlist gives it.

    other is the net of its other contact: ground, supply, or a row of the board's matrix.
    """

    switch: int
    unit: Unit
    pin: str
    pad: str
    other: str


def as_soldered(harness: Harness, boards: Sequence[BoardPins | None]) -> Harness:
    """Return the harness with the buses of its boards as its own, and without the keys that are read through them."""
    behind = {number: board.bus for number, board in enumerate(boards) if board is not None and board.bus is not None}
    scanners = tuple(
        replace(scanner, switches=()) if number in behind else scanner
        for number, scanner in enumerate(harness.scanners)
    )
    return replace(harness, scanners=scanners, buses=(*harness.buses, *behind.values()))


def ends_of(harness: Harness, names: Sequence[str], boards: Sequence[BoardPins | None] = ()) -> tuple[End, ...]:
    """Return the ends of the switches called `names`, in their order; each is wired once in the harness.

    boards[n] says what is known of the pins of scanner n; nothing, where it is None or left out.
    """
    numbers = {name: number for number, name in enumerate(names)}
    found = [*_of_chips(harness, numbers), *_of_boards(harness, numbers, boards)]
    return tuple(sorted(found, key=lambda end: end.switch))


def _of_chips(harness: Harness, numbers: Mapping[str, int]) -> Iterator[End]:
    used = 0
    for bus, wiring in enumerate(harness.buses):
        for chip in wiring.chips:
            kept = {pin: name for pin, name in chip.pins.items() if name in numbers}
            if not kept:
                continue
            used += 1
            unit = Unit(f"U{used}", chip.place, bus, chip)
            other = GROUND if chip.closed == "low" else SUPPLY
            package = chip.chip.package
            yield from (End(numbers[name], unit, pin, package.number(pin), other) for pin, name in kept.items())


def _of_boards(harness: Harness, numbers: Mapping[str, int], boards: Sequence[BoardPins | None]) -> Iterator[End]:
    for number, scanner in enumerate(harness.scanners):
        pins = boards[number] if number < len(boards) else None
        kept = [(key, numbers[name]) for key, name in enumerate(scanner.switches) if name in numbers]
        ref = f"A{number + 1}"
        unit = Unit(ref, f"scanner board at {scanner.port}", diodes=pins is not None and pins.diodes)
        signals = [f"key {key}" if pins is None else pins.signals[key] for key, _ in kept]
        pads = {name: str(pad) for pad, name in enumerate(dict.fromkeys(signals), start=1)}
        for (key, switch), signal in zip(kept, signals, strict=True):
            low = "" if pins is None else pins.lows[key]
            yield End(switch, unit, signal, pads[signal], f"{ref}_{low}" if low else GROUND)
