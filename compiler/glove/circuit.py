"""The circuit of a glove (components and nets), and its bill of materials.

It has switches, the connectors of their bundles, boards and diodes; and expanders with their supply, address,
reset, bus pull-ups, muxes, and the host's plugs.
"""

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from msgspec import Struct

from thenar.drivers import cd74hc4067
from thenar.drivers.i2c import tca9548a
from thenar.drivers.i2c.chips.base import GROUND as GROUND_PINS
from thenar.drivers.i2c.chips.base import RESET, ChipPackage
from thenar.drivers.i2c.chips.base import SUPPLY as SUPPLY_PINS
from thenar.runtime.harness.wiring import ChipWiring, Harness, MuxChannel, SpiWiring

from .layout import GROUND, PUSH_BUTTON, SUPPLY, GloveWire, PlacedSensor, Unit, WireEnd, net_of
from .prices import Part


@dataclass(frozen=True, slots=True)
class ComponentKind:
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
    kind: ComponentKind
    on_board: bool = True
    name: str = ""


@dataclass(slots=True)
class Circuit:
    """Components in order of insertion; nets by name, with the designator and the number of each pin. Built up piece by
    piece, then only read.
    """

    components: list[Component] = field(default_factory=list)
    nets: dict[str, list[tuple[str, str]]] = field(default_factory=dict)

    def put(self, ref: str, kind: ComponentKind, *, on_board: bool = True, name: str = "") -> Component:
        """Add a component called `ref`."""
        self.components.append(Component(ref, kind, on_board, name))
        return self.components[-1]

    def next(self, letter: str, kind: ComponentKind) -> str:
        """Add a component with the next free designator of `letter`, and return that."""
        used = sum(component.ref[: len(letter)] == letter for component in self.components)
        return self.put(f"{letter}{used + 1}", kind).ref

    def join(self, net: str, ref: str, pin: str) -> None:
        """Connect a pin to a net. A pin is on one net at most."""
        self.nets.setdefault(net, []).append((ref, pin))

    def between(self, letter: str, kind: ComponentKind, first: str, second: str) -> str:
        """Add a component with two pins, the first on net `first`; return its designator."""
        ref = self.next(letter, kind)
        for net, (pin, _, _) in zip((first, second), kind.pins, strict=True):
            self.join(net, ref, pin)
        return ref


def header(count: int) -> ComponentKind:
    """Return a row of `count` pins, or of holes to solder wires to."""
    pins = tuple((str(pin), f"Pin_{pin}", "passive") for pin in range(1, count + 1))
    footprint = f"Connector_PinHeader_2.54mm:PinHeader_1x{count:02}_P2.54mm_Vertical"
    return ComponentKind(f"{count} pins", "Connector_Generic", f"Conn_01x{count:02}", footprint, pins)


def two_pins(names: Sequence[str] = ("~", "~")) -> tuple[tuple[str, str, str], ...]:
    """Return the pins 1 and 2 of a passive component."""
    return tuple((str(number), name, "passive") for number, name in enumerate(names, start=1))


def resistor(value: str, note: str = "") -> ComponentKind:
    """Return a resistor to solder by hand."""
    return ComponentKind(
        value, "Device", "R", "Resistor_SMD:R_0805_2012Metric_Pad1.20x1.40mm_HandSolder", two_pins(), note=note
    )


def capacitor(value: str, note: str = "") -> ComponentKind:
    """Return a ceramic capacitor to solder by hand."""
    footprint = "Capacitor_SMD:C_0805_2012Metric_Pad1.18x1.45mm_HandSolder"
    return ComponentKind(value, "Device", "C", footprint, two_pins(), note=note)


_TYPES = {
    **{"SDA": "bidirectional", "SCL": "input", "INT": "open_collector", "NC": "no_connect", RESET: "input"},
    **{"ALERT": "open_collector", "DOUT": "tri_state", cd74hc4067.COMMON: "passive"},
}
_SPI = {"CLK": "SCLK", "DIN": "MOSI", "DOUT": "MISO"}
_ESTIMATE = "an estimate: the straight distance and a quarter more, plus 40 mm for the ends"
_STRANDED = "stranded wire, AWG 30 or thinner, flexible"


_DECOUPLING = capacitor("100n", "one close to each supply pin")
_BULK = capacitor("10u", "at the host's plug")
_RESET_PULL = resistor("10k", "holds RESET high")


def _add_expanders(circuit: Circuit, units: Sequence[Unit], ends: Sequence[WireEnd], harness: Harness) -> None:
    """Add the expanders among `units` and the muxes in front of them, and a plug and pull-ups for each bus."""
    channels: dict[int, set[tuple[int, int]]] = {}
    for unit in units:
        wiring = unit.wiring
        if not isinstance(wiring, ChipWiring):
            continue
        chip, package = wiring.chip, wiring.chip.package
        circuit.put(unit.ref, _kind(package, chip.pins), name=unit.place)
        sda, scl = _wires(unit.bus, wiring.mux)
        _add_power(circuit, unit.ref, package, wiring.address - chip.addresses[0], (sda, scl))
        circuit.join(sda, unit.ref, package.number("SDA"))
        circuit.join(scl, unit.ref, package.number("SCL"))
        if not chip.pulls_up:
            _ground_unused(circuit, unit, package, chip.pins, ends)
        muxes = channels.setdefault(unit.bus, set())
        muxes |= set() if wiring.mux is None else {(wiring.mux.address, wiring.mux.channel)}
    for bus, muxes in channels.items():
        clock_hz = harness.buses[bus].clock_hz
        _add_muxes(circuit, bus, sorted(muxes), clock_hz)
        wires = _wires(bus, None)
        _add_plug(circuit, (SUPPLY, GROUND, *wires))
        for wire in wires:
            circuit.between("R", _pull_up(clock_hz), SUPPLY, wire)


def _ground_unused(
    circuit: Circuit, unit: Unit, package: ChipPackage, pins: Sequence[str], ends: Sequence[WireEnd]
) -> None:
    """Ground unconnected inputs: a floating one draws current, or disturbs its neighbours."""
    used = {end.pin for end in ends if end.unit == unit}
    for pin in pins:
        if pin not in used:
            circuit.join(GROUND, unit.ref, package.number(pin))


def _add_spi(circuit: Circuit, units: Sequence[Unit], ends: Sequence[WireEnd]) -> None:
    """Add the converters on SPI, and a plug for each bus with a select line for each of them."""
    lines: dict[str, list[str]] = {}
    for unit in units:
        if not isinstance(unit.wiring, SpiWiring):
            continue
        bus, _, chip = unit.wiring.device.rpartition("spidev")[2].partition(".")
        package = unit.wiring.chip.package
        circuit.put(unit.ref, _kind(package, unit.wiring.chip.pins), name=unit.place)
        _add_power(circuit, unit.ref, package, 0, ("", ""))
        select = f"CS{bus}_{chip}"
        for pin, net in (*((pin, f"{name}{bus}") for pin, name in _SPI.items()), ("CS", select)):
            circuit.join(net, unit.ref, package.number(pin))
        _ground_unused(circuit, unit, package, unit.wiring.chip.pins, ends)
        lines.setdefault(bus, []).append(select)
    for bus, selects in lines.items():
        _add_plug(circuit, (SUPPLY, GROUND, *(f"{name}{bus}" for name in _SPI.values()), *selects))


def _add_multiplexers(circuit: Circuit, units: Sequence[Unit], ends: Sequence[WireEnd]) -> None:
    """Add the multiplexers of boards: a board selects the same channel on all of them, and reads their commons."""
    package = cd74hc4067.PACKAGE
    inputs = tuple(f"I{channel}" for channel in range(cd74hc4067.CHANNELS))
    for unit in units:
        circuit.put(unit.ref, _kind(package, inputs), name=unit.place)
        _add_power(circuit, unit.ref, package, 0, ("", ""))
        circuit.join(GROUND, unit.ref, package.number(cd74hc4067.ENABLE))
        for pin in cd74hc4067.SELECTS:
            circuit.join(f"{unit.board}_{pin}", unit.ref, package.number(pin))
        circuit.join(f"{unit.board}_{cd74hc4067.COMMON}{unit.bus}", unit.ref, package.number(cd74hc4067.COMMON))
        _ground_unused(circuit, unit, package, inputs, ends)


def _add_power(circuit: Circuit, ref: str, package: ChipPackage, above: int, bus: tuple[str, str]) -> None:
    """Connect supply, ground, reset and address of a chip on a bus, `above` its lowest address."""
    nets = {"low": GROUND, "high": SUPPLY, "SDA": bus[0], "SCL": bus[1]}
    for number, name in enumerate(package.pins, start=1):
        if name in GROUND_PINS:
            circuit.join(GROUND, ref, str(number))
        if name in SUPPLY_PINS:
            circuit.join(SUPPLY, ref, str(number))
            circuit.between("C", _DECOUPLING, SUPPLY, GROUND)
    for name, to in package.selects(above):
        circuit.join(nets[to], ref, package.number(name))
    if RESET in package.pins:
        circuit.join(f"{ref}_{RESET}", ref, package.number(RESET))
        circuit.between("R", _RESET_PULL, SUPPLY, f"{ref}_{RESET}")


def _add_muxes(circuit: Circuit, bus: int, channels: Sequence[tuple[int, int]], clock_hz: int) -> None:
    for address in dict.fromkeys(address for address, _ in channels):
        ref = circuit.next("U", _kind(tca9548a.PACKAGE, ()))
        _add_power(circuit, ref, tca9548a.PACKAGE, address - tca9548a.ADDRESSES[0], _wires(bus, None))
        for wire, pin in zip(_wires(bus, None), ("SDA", "SCL"), strict=True):
            circuit.join(wire, ref, tca9548a.PACKAGE.number(pin))
        for channel in (channel for at, channel in channels if at == address):
            pair = _wires(bus, MuxChannel(address=address, channel=channel))
            for wire, pin in zip(pair, (f"SD{channel}", f"SC{channel}"), strict=True):
                circuit.join(wire, ref, tca9548a.PACKAGE.number(pin))
                circuit.between("R", _pull_up(clock_hz), SUPPLY, wire)


def _add_plug(circuit: Circuit, nets: Sequence[str]) -> None:
    """Add a plug of the host with a pin for each of these nets."""
    ref = circuit.next("J", header(len(nets)))
    for number, net in enumerate(nets, start=1):
        circuit.join(net, ref, str(number))
    circuit.between("C", _BULK, SUPPLY, GROUND)


def _wires(bus: int, mux: MuxChannel | None) -> tuple[str, str]:
    """Return the nets of a bus, or of a mux channel of it."""
    where = f"{bus}" if mux is None else f"{bus}_{mux.address:02X}_{mux.channel}"
    return f"SDA{where}", f"SCL{where}"


def _pull_up(clock_hz: int) -> ComponentKind:
    """Return a bus pull-up with which 150 pF and more rise in the time that the speed allows (UM10204)."""
    note = "leave it out if the host has its own"
    if clock_hz <= 100_000:
        return resistor("4k7", note)
    if clock_hz <= 400_000:
        return resistor("2k2", note)
    return resistor("1k", f"{note}; for {clock_hz} Hz, with short wires only: measure the rise time")


def _kind(package: ChipPackage, inputs: Sequence[str]) -> ComponentKind:
    def type_of(name: str) -> str:
        if name in (*SUPPLY_PINS, *GROUND_PINS):
            return "power_in"
        return "bidirectional" if name in inputs or name[:2] in ("SD", "SC") else _TYPES.get(name, "input")

    pins = tuple((str(number), name, type_of(name)) for number, name in enumerate(package.pins, start=1))
    return ComponentKind(
        package.part,
        package.library,
        package.symbol,
        package.footprint,
        pins,
        part=package.part,
        maker=package.maker,
        sure=package.sure,
        note=package.note,
    )


_BUTTON = ComponentKind(
    PUSH_BUTTON,
    "Switch",
    "SW_Push",
    "Button_Switch_SMD:SW_SPST_Panasonic_EVQPL_3PL_5PL_PT_A15",
    two_pins(("1", "2")),
    part=PUSH_BUTTON,
    maker="Panasonic",
    note="light touch switch, 4.9 x 4.9 x 1.5 mm; its operating force of 1.0 N is not confirmed by a data sheet",
)
_OWN_SWITCH = ComponentKind(
    "your own switch or pad",
    "Switch",
    "SW_SPST",
    "",
    two_pins(("1", "2")),
    note="a contact between its two wires; a pad recorded as a voltage needs a comparator at its threshold",
)
_PAD = ComponentKind(
    "your own force sensing pad",
    "Device",
    "R_Variable",
    "",
    two_pins(("1", "2")),
    note="its resistance falls with force; it is the upper half of a divider between the supply and an analog input",
)
_DIODE = ComponentKind(
    "Schottky, 30 V",
    "Device",
    "D_Schottky",
    "Diode_SMD:D_SOD-323_HandSoldering",
    (("1", "K", "passive"), ("2", "A", "passive")),
    note="such as a BAT54 of this package; at 5 V a 1N4148 is sufficient",
)
# Pull-downs win against a chip's own pull-ups of 40 uA and more; pull-ups are for inputs that have none.
_PULL_DOWN = resistor("4k7", "pulls an input down against the chip's own pull-up")
_DIVIDER = resistor("10k", "lower half of a pad's divider: equal to the pad's resistance at the most important force")
_PULL_UP = resistor("10k", "pulls up an input of a chip without pull-ups")


def glove_circuit(
    switches: Sequence[PlacedSensor],
    ends: Sequence[WireEnd],
    wires: Sequence[GloveWire],
    harness: Harness,
    part_number: str,
) -> Circuit:
    """Return the circuit in which each sensor reaches its `end` through its bundle's connector.

    part_number is that of the switches, or of the pads of a glove without switches; "" if unknown.
    """
    circuit = Circuit()
    kind = _BUTTON if part_number == PUSH_BUTTON else replace(_OWN_SWITCH, part=part_number)
    pad = _PAD if any(sensor.kind == "switch" for sensor in switches) else replace(_PAD, part=part_number)
    for sensor in switches:
        circuit.put(sensor.ref, pad if sensor.kind == "pad" else kind, on_board=False, name=sensor.name)
    bundles: dict[tuple[str, str], list[GloveWire]] = {}
    for wire in wires:
        bundles.setdefault((wire.connector, wire.bundle), []).append(wire)
    for (ref, bundle), group in bundles.items():
        circuit.put(ref, header(len(group)), name=f"{bundle} bundle")
        for wire in group:
            circuit.join(wire.net, ref, str(wire.pin))
    # The readers of switches: the boards, then the chips, by number.
    units = sorted({end.unit.ref: end.unit for end in ends}.values(), key=lambda unit: (unit.ref[0], int(unit.ref[1:])))
    multiplexers = [unit for unit in units if unit.board]
    for ref in sorted({unit.board or unit.ref for unit in units if unit.wiring is None}):
        _add_board(
            circuit, ref, [end for end in ends if end.unit.ref == ref], [m for m in multiplexers if m.board == ref]
        )
    for end in ends:
        _add_signal(circuit, end, switches[end.switch])
    _add_spi(circuit, units, ends)
    _add_multiplexers(circuit, multiplexers, ends)
    _add_expanders(circuit, units, ends, harness)
    return circuit


def _add_board(circuit: Circuit, ref: str, ends: Sequence[WireEnd], multiplexers: Sequence[Unit]) -> None:
    """Add a board, with ground and every pin that a kept switch or a multiplexer needs."""
    signals = {end.pad: end.pin for end in ends}
    lines = [f"{ref}_{pin}" for pin in cd74hc4067.SELECTS] if multiplexers else []
    lines += [f"{ref}_{cd74hc4067.COMMON}{unit.bus}" for unit in multiplexers]
    nets = dict.fromkeys([*(end.other for end in ends), *lines, GROUND])
    named = {**signals, **{str(number): net for number, net in enumerate(nets, start=len(signals) + 1)}}
    pins = tuple((pad, name, "bidirectional") for pad, name in named.items())
    circuit.put(ref, ComponentKind("board", "thenar", f"board_{ref}", "", pins), on_board=False)
    for number, net in enumerate(nets, start=len(signals) + 1):
        circuit.join(net, ref, str(number))
    for end in {end.pad: end for end in ends if end.unit.diodes and not end.taxel}.values():
        circuit.join(f"{ref}_{end.pin}", ref, end.pad)


def _add_signal(circuit: Circuit, end: WireEnd, switch: PlacedSensor) -> None:
    """Connect a switch to its reader, with the diode or the resistor that it needs there."""
    net, wiring = net_of(end, switch), end.unit.wiring
    circuit.join(net, switch.ref, "1")
    circuit.join(end.other, switch.ref, "2")
    if end.unit.diodes and not end.taxel:
        circuit.between("D", _DIODE, net, f"{end.unit.ref}_{end.pin}")
        return
    if (end.unit.ref, end.pad) not in circuit.nets[net]:
        circuit.join(net, end.unit.ref, end.pad)
    if end.taxel:
        circuit.between("R", _DIVIDER, net, GROUND)
    elif isinstance(wiring, ChipWiring) and end.other == SUPPLY:
        circuit.between("R", _PULL_DOWN, net, GROUND)
    elif isinstance(wiring, ChipWiring) and not wiring.chip.pulls_up:
        circuit.between("R", _PULL_UP, net, SUPPLY)


class BillLine(Struct, frozen=True):
    """A line of the bill: `part` is an orderable part number of `maker`, empty if unknown.

    sure is False if part or footprint is not confirmed twice: compare with the data sheet before ordering.
    quantity counts pieces, or metres if `unit` is "m"; price is that of one, None if unknown.
    """

    quantity: float
    unit: str
    what: str
    part: str
    maker: str
    footprint: str
    designators: tuple[str, ...]
    sure: bool
    note: str
    price: float | None = None


def bill_of(circuit: Circuit, wires: Sequence[GloveWire], listed: Container[str] = ()) -> Iterator[BillLine]:
    """Yield the bill of materials for a glove's circuit and its wires, without the sensors `listed` by name."""
    groups: dict[ComponentKind, list[str]] = {}
    for component in circuit.components:
        if component.on_board or component.name not in listed:
            groups.setdefault(component.kind, []).append(component.ref)
    devices = {"R": "resistor ", "C": "ceramic capacitor ", "R_Variable": ""}
    for kind, refs in groups.items():
        what = kind.value
        if kind.library == "Device":
            what = f"{devices.get(kind.symbol, 'diode ')}{what}"
        elif kind.library == "Connector_Generic":
            what = f"header or holes, {what}"
        yield BillLine(
            quantity=len(refs),
            unit="pcs",
            what=what,
            part=kind.part,
            maker=kind.maker,
            footprint=kind.footprint,
            designators=tuple(refs),
            sure=kind.sure,
            note=kind.note,
        )
    colours: dict[str, list[GloveWire]] = {}
    for wire in wires:
        colours.setdefault(wire.colour.partition(",")[0], []).append(wire)
    for colour, group in colours.items():
        lengths = [wire.length_mm for wire in group if wire.length_mm is not None]
        connectors = tuple(dict.fromkeys(wire.connector for wire in group))
        if lengths:
            yield BillLine(sum(lengths) / 1000, "m", f"{_STRANDED}, {colour}", "", "", "", connectors, True, _ESTIMATE)


def bill_of_parts(sensors: Mapping[str, str], parts: Mapping[str, Part]) -> Iterator[BillLine]:
    """Yield a line for each part of a price list that sensors, designators by name, are made of."""
    for part in dict.fromkeys(parts[name] for name in sensors):
        refs = tuple(ref for name, ref in sensors.items() if parts[name] == part)
        yield BillLine(len(refs), "pcs", part.name, part.number, "", "", refs, True, "of the price list", part.price)


def bill_of_joints(joints: Sequence[str], cyberglove: bool) -> tuple[BillLine, ...]:
    """Return the sensors of the joints, which are not on the board: those of a CyberGlove, or one for each joint."""
    if not joints:
        return ()
    what, names = ("CyberGlove", ()) if cyberglove else ("your own joint sensor", tuple(joints))
    note = "it measures the kept joints" if cyberglove else "such as a flex sensor along the joint"
    return (BillLine(len(names) or 1, "pcs", what, "", "", "", names, True, note),)
