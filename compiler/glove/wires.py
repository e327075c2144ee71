"""The harness of wires: a bundle per digit, a wire per switch, a common return, colours and lengths."""

from collections.abc import Iterator, Sequence
from math import ceil, hypot

from msgspec import Struct
from msgspec.structs import replace

from ..hand import HandShape
from .ends import GROUND, End
from .placing import PlacedSwitch

# The resistor colour code from 1 to 9; black is the return's.
COLOURS = ("brown", "red", "orange", "yellow", "green", "blue", "violet", "grey", "white")
_RETURN = "black"
# Estimates: a wire's way is so much longer than straight, and so much of it is needed at its ends and at each switch.
_DETOUR, _ENDS_MM, _SPLICE_MM, _STEP_MM = 1.25, 40.0, 10.0, 5
_LONGEST_HEADER = 40

Place = tuple[float, float]


class Wire(Struct, frozen=True):
    """A wire from switches to the wrist: through pin `pin` of connector `connector` to `net`.

    switches are the numbers of those on it: one where it carries a signal, all that share it where it is a return.
    unit and input say which pin or key reads it, and are empty for a return. length_mm is an estimate, None where
    nobody knows the places.
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


def wires_of(switches: Sequence[PlacedSwitch], ends: Sequence[End], hand: HandShape | None) -> tuple[Wire, ...]:
    """Return all wires, bundle by bundle: the signals in the switches' order, then the returns chip by chip.

    A bundle holds a digit's wires; one unit's, where the places are not known.
    """
    home = None if hand is None else wrist_of(hand)
    bundles: dict[str, list[End]] = {}
    for end in ends:
        bundles.setdefault(switches[end.switch].part or end.unit.ref, []).append(end)
    order = list(bundles) if hand is None else [part for part in hand.part_names if part in bundles]
    made: list[Wire] = []
    connectors = 0
    for bundle in order:
        wires = [*_signals(bundle, bundles[bundle], switches, home), *_returns(bundle, bundles[bundle], switches, home)]
        for start in range(0, len(wires), _LONGEST_HEADER):
            connectors += 1
            made += _connected(wires[start : start + _LONGEST_HEADER], f"J{connectors}")
    return tuple(made)


def wrist_of(hand: HandShape) -> Place:
    """Return where the chips sit: in the middle of the glove's cuff."""
    x, y = (hand.outline[0] + hand.outline[-1]) / 2
    return float(x), float(y)


def marked(colour: str, times: int) -> str:
    """Return a colour's name for its second, third ... use in a bundle."""
    return colour if not times else f"{colour}, {times} mark{'s' if times > 1 else ''}"


def net_of(end: End, switch: PlacedSwitch) -> str:
    """Return the net of a switch's contact 1: its own, or its column's in a matrix without diodes.

    The stroke keeps it apart from GND and VCC, whatever a switch is called.
    """
    shared = end.unit.wiring is None and end.other != GROUND and not end.unit.diodes
    return f"{end.unit.ref}_{end.pin}" if shared else f"/{switch.name}"


def _connected(wires: Sequence[Wire], connector: str) -> Iterator[Wire]:
    return (replace(wire, connector=connector, pin=pin) for pin, wire in enumerate(wires, start=1))


def _signals(bundle: str, ends: Sequence[End], switches: Sequence[PlacedSwitch], home: Place | None) -> Iterator[Wire]:
    for number, end in enumerate(ends):
        switch = switches[end.switch]
        yield Wire(
            bundle=bundle,
            connector="",
            pin=0,
            colour=marked(COLOURS[number % len(COLOURS)], number // len(COLOURS)),
            net=net_of(end, switch),
            switches=(switch.number,),
            unit=end.unit.ref,
            input=end.pin,
            length_mm=_length([switch], home),
        )


def _returns(bundle: str, ends: Sequence[End], switches: Sequence[PlacedSwitch], home: Place | None) -> Iterator[Wire]:
    shared: dict[tuple[str, str], list[PlacedSwitch]] = {}
    for end in ends:
        shared.setdefault((end.unit.ref, end.other), []).append(switches[end.switch])
    for number, ((_, net), group) in enumerate(shared.items()):
        colour = marked(_RETURN, number)
        numbers = tuple(switch.number for switch in group)
        yield Wire(bundle, "", 0, colour, net, numbers, "", "", _length(group, home))


def _length(group: Sequence[PlacedSwitch], home: Place | None) -> int | None:
    """Return the estimated length of a wire from the wrist through all of `group`, the nearest first; mm."""
    if home is None:
        return None
    stops = [(switch.x_mm or 0.0, switch.y_mm or 0.0) for switch in group]
    stops.sort(key=lambda stop: (hypot(stop[0] - home[0], stop[1] - home[1]), stop))
    way = sum(hypot(b[0] - a[0], b[1] - a[1]) for a, b in zip([home, *stops], stops, strict=False))
    return _STEP_MM * ceil((_DETOUR * way + _ENDS_MM + _SPLICE_MM * (len(stops) - 1)) / _STEP_MM)
