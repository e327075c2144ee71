"""The positions of the kept switches on the hand, the pin of each wire, and the bundles in between."""

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from math import ceil, hypot
from typing import Literal

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from thenar.drivers import cd74hc4067
from thenar.runtime.harness.wiring import BoardWiring, BusWiring, ChipWiring, Harness, SpiWiring, StreamWiring
from thenar.runtime.scanning.ports import levels_of

from ..hand import HandShape
from ..text import counted, listed

# The switch of Murakami et al.'s glove, and its disc that touches the skin.
PUSH_BUTTON, CONTACT_MM = "EVQPLDA15", 3.2
_SIDES = {-1: "left side", 0: "palm side", 1: "right side"}
GROUND, SUPPLY = "GND", "VCC"
# The resistor colour code from 1 to 9; black is the return.
COLOURS = ("brown", "red", "orange", "yellow", "green", "blue", "violet", "grey", "white")
_RETURN = "black"
# Estimates: the factor on the straight distance, and the extra length at the ends and at each switch.
_DETOUR, _ENDS_MM, _SPLICE_MM, _STEP_MM = 1.25, 40.0, 10.0, 5
_LONGEST_HEADER = 40
# Of a board's own bus: what Arduino's cores start it with.
_BOARD_HZ = 100_000
Place = tuple[float, float]


class PlacedSensor(Struct, frozen=True):
    """A sensor of the reduced glove: a switch, or a pad with all its levels.

    ref is its designator everywhere, such as SW3 or PAD4: its number counts both. part is the digit, or "palm"; side is
    its side, left and right as drawn: palm up, thumb right. x_mm counts towards the thumb and y_mm towards the
    fingertips on the flat pattern, from the middle of the wrist's crease. All are None if the positions of the glove's
    sensors are unknown.
    """

    number: int
    name: str
    kind: Literal["switch", "pad"] = "switch"
    part: str | None = None
    side: str | None = None
    x_mm: float | None = None
    y_mm: float | None = None

    @property
    def ref(self) -> str:
        """Its designator."""
        return f"{'PAD' if self.kind == 'pad' else 'SW'}{self.number}"


def place_sensors(names: Sequence[str], pads: Container[str], hand: HandShape | None) -> tuple[PlacedSensor, ...]:
    """Return the sensors called `names`, all known to `hand` if given; millimetres with one decimal."""
    kinds: list[Literal["switch", "pad"]] = ["pad" if name in pads else "switch" for name in names]
    if hand is None:
        return tuple(map(PlacedSensor, range(1, len(names) + 1), names, kinds))
    return tuple(
        PlacedSensor(
            number=number,
            name=name,
            kind=kinds[number - 1],
            part=hand.part_names[hand.parts[mine]],
            side=None if hand.length_mm is None else _SIDES[int(hand.sides[mine])],
            x_mm=round(float(hand.places[mine, 0]), 1),
            y_mm=round(float(hand.places[mine, 1]), 1),
        )
        for number, (name, mine) in enumerate(zip(names, hand.numbers_of(names), strict=True), start=1)
    )


def counted_sensors(sensors: Sequence[PlacedSensor]) -> str:
    """Return "3 switches and 8 pads"; a kind of which there are none is left out."""
    kinds = [sensor.kind for sensor in sensors]
    words = {"switch": ("switch", "switches"), "pad": ("pad", "pads")}
    return listed([counted(kinds.count(kind), *words[kind]) for kind in words if kind in kinds])


def hole_mm(hand: HandShape) -> float:
    """Return the diameter of a switch's hole: the push button's disc, or the whole switch if its width is known."""
    return CONTACT_MM if hand.part_number == PUSH_BUTTON or not hand.body_mm else hand.body_mm


def crowded(switches: Sequence[PlacedSensor], body_mm: float) -> list[tuple[int, int, float]]:
    """Return pairs of switches whose centres are closer than the width of a switch, with their distance in mm."""
    places = np.array([(each.x_mm, each.y_mm) for each in switches if each.x_mm is not None]).reshape(-1, 2)
    apart = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
    first, second = np.nonzero(np.triu(apart < body_mm, k=1))
    return [(int(a) + 1, int(b) + 1, round(float(apart[a, b]), 2)) for a, b in zip(first, second, strict=True)]


@dataclass(frozen=True, slots=True)
class Unit:
    """A reader of switches: a chip of a harness, or, without `wiring`, a board, or the multiplexer of a `board`.

    ref is its designator in the netlist; place, its name in messages and tables.
    """

    ref: str
    place: str
    bus: int = 0
    wiring: ChipWiring | SpiWiring | None = None
    diodes: bool = False
    board: str = ""


@dataclass(frozen=True, slots=True)
class WireEnd:
    """The end of a switch's wire: pin is a name, pad its number in the netlist.

    other is the net of its other contact: ground, supply, or a row of the board's matrix. A taxel is the upper half of
    a divider.
    """

    switch: int
    unit: Unit
    pin: str
    pad: str
    other: str
    taxel: bool = False


def as_soldered(harness: Harness) -> Harness:
    """Return the harness with the chips of its boards on direct buses, and not among the boards' inputs."""
    buses = [
        BusWiring(device=stream.port, clock_hz=_BOARD_HZ, chips=stream.board.chips)
        for stream in harness.streams
        if stream.board is not None and stream.board.chips
    ]
    return replace(harness, buses=(*harness.buses, *buses), streams=tuple(map(_without_chips, harness.streams)))


def _without_chips(stream: StreamWiring) -> StreamWiring:
    if stream.board is None:
        return stream
    behind = {name for chip in stream.board.chips for name in chip.pins.values()}
    switches = tuple(name for name in stream.switches if name not in behind)
    return replace(stream, switches=switches, board=replace(stream.board, chips=()))


def elements_of(harness: Harness, names: Sequence[str]) -> tuple[str, ...]:
    """Return the elements to place and wire for a build's switches and levels of these names.

    A taxel occurs once, under its own name, at the place of its first level.
    """
    taxels = {number: taxel for taxel, pairs in levels_of(harness, names).items() for _, number in pairs}
    return tuple(dict.fromkeys(taxels.get(number, name) for number, name in enumerate(names)))


def ends_of(harness: Harness, names: Sequence[str]) -> tuple[WireEnd, ...]:
    """Return the ends of the switches called `names`, in order; each is wired once in the harness."""
    numbers, chips = {name: number for number, name in enumerate(names)}, count(1)
    found = [*_of_chips(harness, numbers, chips), *_of_boards(harness, numbers, chips)]
    return tuple(sorted(found, key=lambda end: end.switch))


def _of_chips(harness: Harness, numbers: Mapping[str, int], used: Iterator[int]) -> Iterator[WireEnd]:
    chips: list[tuple[int, ChipWiring | SpiWiring]] = [
        (bus, chip) for bus, wiring in enumerate(harness.buses) for chip in wiring.chips
    ]
    for bus, chip in (*chips, *enumerate(harness.spi)):
        kept = {pin: name for pin, name in chip.pins.items() if name in numbers}
        if not kept:
            continue
        unit = Unit(f"U{next(used)}", chip.place, bus, chip)
        taxels = isinstance(chip, SpiWiring) or chip.measures
        other = SUPPLY if isinstance(chip, SpiWiring) or taxels or chip.closed == "high" else GROUND
        number = chip.chip.package.number
        yield from (WireEnd(numbers[name], unit, pin, number(pin), other, taxels) for pin, name in kept.items())


def _of_boards(harness: Harness, numbers: Mapping[str, int], used: Iterator[int]) -> Iterator[WireEnd]:
    """Yield the ends at boards; the pins of a sender whose board is not known are its columns."""
    for number, stream in enumerate(harness.streams):
        board = stream.board or BoardWiring(pins={name: name for name in (*stream.switches, *stream.taxels)})
        ref, matrix = f"A{number + 1}", board.matrix
        unit = Unit(ref, f"board at {stream.port}", diodes=matrix is not None and matrix.diodes)
        plain: list[tuple[str, str, str]] = []  # name, pin, other net
        for name, pin in board.pins.items():
            if name in numbers and not (stream.board is not None and "." in pin):
                plain.append((name, pin, SUPPLY if name in stream.taxels else GROUND))
        if matrix is not None:
            keys = zip(matrix.rows, matrix.keys, strict=True)
            plain += [
                (name, column, f"{ref}_{row}")
                for row, names in keys
                for column, name in zip(matrix.columns, names, strict=True)
                if name in numbers
            ]
        pads = {pin: str(pad) for pad, pin in enumerate(dict.fromkeys(pin for _, pin, _ in plain), start=1)}
        for name, pin, other in plain:
            yield WireEnd(numbers[name], unit, pin, pads[pin], other, taxel=name in stream.taxels)
        if stream.board is not None:
            yield from _of_multiplexers(stream, stream.board, ref, numbers, used)


def _of_multiplexers(
    stream: StreamWiring, board: BoardWiring, ref: str, numbers: Mapping[str, int], used: Iterator[int]
) -> Iterator[WireEnd]:
    """Yield the ends of a board's taxels at its multiplexers; multiplexers without a kept taxel are left out."""
    units: dict[str, Unit] = {}
    for name, pin in board.pins.items():
        common, _, channel = pin.partition(".")
        if channel and name in numbers:
            if common not in units:
                place = f"cd74hc4067 at {common} of the board at {stream.port}"
                units[common] = Unit(f"U{next(used)}", place, len(units), board=ref)
            package = cd74hc4067.PACKAGE
            yield WireEnd(
                numbers[name], units[common], f"I{channel}", package.number(f"I{channel}"), SUPPLY, taxel=True
            )


class GloveWire(Struct, frozen=True):
    """A wire from switches to the wrist: through pin `pin` of connector `connector` to `net`.

    switches are the numbers of those on it: one for a signal, all that share it for a return. unit and input say which
    pin reads it, and are empty for a return. length_mm is an estimate, None if the positions are unknown.
    """

    bundle: str
    connector: str
    pin: int
    colour: str
    net: str
    switches: tuple[int, ...]
    unit: str
    input: str
    length_mm: int | None


def wires_of(
    switches: Sequence[PlacedSensor], ends: Sequence[WireEnd], hand: HandShape | None
) -> tuple[GloveWire, ...]:
    """Return all wires, bundle by bundle: the signals in the switches' order, then the returns chip by chip.

    A bundle holds the wires of one digit; or those of one unit, if the positions are unknown.
    """
    home = None if hand is None else hand.wrist
    bundles: dict[str, list[WireEnd]] = {}
    for end in ends:
        bundles.setdefault(switches[end.switch].part or end.unit.ref, []).append(end)
    order = list(bundles) if hand is None else [part for part in hand.part_names if part in bundles]
    made: list[GloveWire] = []
    connectors = 0
    for bundle in order:
        wires = list(_wires(bundle, bundles[bundle], switches, home))
        for start in range(0, len(wires), _LONGEST_HEADER):
            connectors += 1
            group = wires[start : start + _LONGEST_HEADER]
            made += [replace(wire, connector=f"J{connectors}", pin=pin) for pin, wire in enumerate(group, start=1)]
    return tuple(made)


def marked(colour: str, times: int) -> str:
    """Return a colour's name for its first, second, third ... use in a bundle."""
    return colour if not times else f"{colour}, {times} mark{'s' if times > 1 else ''}"


def net_of(end: WireEnd, switch: PlacedSensor) -> str:
    """Return the net of a switch's contact 1: a separate one, or its column's in a matrix without diodes.

    The stroke distinguishes it from GND and VCC, whatever a switch is called.
    """
    shared = end.unit.wiring is None and end.other != GROUND and not end.unit.diodes and not end.taxel
    return f"{end.unit.ref}_{end.pin}" if shared else f"/{switch.name}"


def _wires(
    bundle: str, ends: Sequence[WireEnd], switches: Sequence[PlacedSensor], home: Place | None
) -> Iterator[GloveWire]:
    """Yield the wires of a bundle without their connectors: a signal for each end, then the returns that ends share."""
    shared: dict[tuple[str, str], list[PlacedSensor]] = {}
    for number, end in enumerate(ends):
        switch = switches[end.switch]
        shared.setdefault((end.unit.ref, end.other), []).append(switch)
        colour, length = marked(COLOURS[number % len(COLOURS)], number // len(COLOURS)), _length([switch], home)
        net, unit = net_of(end, switch), end.unit.ref
        yield GloveWire(bundle, "", 0, colour, net, (switch.number,), unit, end.pin, length)
    for number, ((_, net), group) in enumerate(shared.items()):
        numbers = tuple(switch.number for switch in group)
        yield GloveWire(bundle, "", 0, marked(_RETURN, number), net, numbers, "", "", _length(group, home))


def _length(group: Sequence[PlacedSensor], home: Place | None) -> int | None:
    """Return the estimated length in mm of a wire from the wrist through all of `group`, the nearest first."""
    if home is None:
        return None
    stops = [(switch.x_mm or 0.0, switch.y_mm or 0.0) for switch in group]
    stops.sort(key=lambda stop: (hypot(stop[0] - home[0], stop[1] - home[1]), stop))
    way = sum(hypot(b[0] - a[0], b[1] - a[1]) for a, b in zip([home, *stops], stops, strict=False))
    return _STEP_MM * ceil((_DETOUR * way + _ENDS_MM + _SPLICE_MM * (len(stops) - 1)) / _STEP_MM)
