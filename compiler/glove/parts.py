"""A circuit as data: components and their kinds, the nets between their pins, and the kinds that every circuit uses."""

from collections.abc import Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of component: its name in KiCad, and the part to buy.

    pins holds (number, name, KiCad's electrical type) triples. part and maker are empty unless an orderable part number
    is known; sure says whether everything here is confirmed twice, and note what is not, or what to watch for.
    """

    value: str
    library: str
    symbol: str
    footprint: str
    pins: tuple[tuple[str, str, str], ...]
    part: str = ""
    maker: str = ""
    sure: bool = True
    note: str = ""


@dataclass(frozen=True, slots=True)
class Component:
    """One component: its designator, and whether it sits on the board at the wrist or elsewhere on the glove."""

    ref: str
    kind: Kind
    on_board: bool = True
    name: str = ""


@dataclass(frozen=True, slots=True)
class Terminal:
    """A pin of a component."""

    ref: str
    pin: str


@dataclass(slots=True)
class Circuit:
    """Components in order of insertion, nets by name; built up piece by piece, then only read."""

    components: list[Component] = field(default_factory=list)
    nets: dict[str, list[Terminal]] = field(default_factory=dict)

    def put(self, ref: str, kind: Kind, *, on_board: bool = True, name: str = "") -> Component:
        """Add a component called `ref`."""
        self.components.append(Component(ref, kind, on_board, name))
        return self.components[-1]

    def next(self, letter: str, kind: Kind) -> str:
        """Add a component with the next free designator of `letter`, and return that."""
        used = sum(component.ref[: len(letter)] == letter for component in self.components)
        return self.put(f"{letter}{used + 1}", kind).ref

    def join(self, net: str, ref: str, pin: str) -> None:
        """Connect a pin to a net. A pin is on one net at most."""
        self.nets.setdefault(net, []).append(Terminal(ref, pin))

    def between(self, letter: str, kind: Kind, first: str, second: str) -> str:
        """Add a component with two pins, the first on net `first`; return its designator."""
        ref = self.next(letter, kind)
        for net, (pin, _, _) in zip((first, second), kind.pins, strict=True):
            self.join(net, ref, pin)
        return ref


def header(count: int) -> Kind:
    """Return a row of `count` pins, or of holes to solder wires to."""
    pins = tuple((str(pin), f"Pin_{pin}", "passive") for pin in range(1, count + 1))
    footprint = f"Connector_PinHeader_2.54mm:PinHeader_1x{count:02}_P2.54mm_Vertical"
    return Kind(f"{count} pins", "Connector_Generic", f"Conn_01x{count:02}", footprint, pins)


def two_pins(names: Sequence[str] = ("~", "~")) -> tuple[tuple[str, str, str], ...]:
    """Return the pins 1 and 2 of a passive component."""
    return tuple((str(number), name, "passive") for number, name in enumerate(names, start=1))


def resistor(value: str, note: str = "") -> Kind:
    """Return a resistor to solder by hand."""
    return Kind(value, "Device", "R", "Resistor_SMD:R_0805_2012Metric_Pad1.20x1.40mm_HandSolder", two_pins(), note=note)


def capacitor(value: str, note: str = "") -> Kind:
    """Return a ceramic capacitor to solder by hand."""
    footprint = "Capacitor_SMD:C_0805_2012Metric_Pad1.18x1.45mm_HandSolder"
    return Kind(value, "Device", "C", footprint, two_pins(), note=note)
