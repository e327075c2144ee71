"""The expanders of a glove's circuit: supply, address, reset, the pull-ups of each bus, muxes, and the host's plugs."""

from collections.abc import Sequence

from thenar.drivers.i2c import tca9548a
from thenar.drivers.i2c.chips.base import GROUND as GROUND_PINS
from thenar.drivers.i2c.chips.base import RESET, Package
from thenar.drivers.i2c.chips.base import SUPPLY as SUPPLY_PINS
from thenar.runtime.harness.wiring import Harness, MuxChannel

from .circuit import Circuit, Kind, capacitor, header, resistor
from .ends import GROUND, SUPPLY, End, Unit

_DECOUPLING = capacitor("100n", "one close to each supply pin")
_BULK = capacitor("10u", "where the host's plug comes in")
_RESET_PULL = resistor("10k", "holds RESET high")
_HOST = ("VCC", "GND", "SDA", "SCL")
_TYPES = {"SDA": "bidirectional", "SCL": "input", "INT": "open_collector", "NC": "no_connect", RESET: "input"}


def add_expanders(circuit: Circuit, units: Sequence[Unit], ends: Sequence[End], harness: Harness) -> None:
    """Put in the expanders `units` and the muxes that they are behind, each bus with its plug and pull-ups."""
    if not units:
        return
    for unit in units:
        _add_expander(circuit, unit, [end for end in ends if end.unit == unit])
    for bus in dict.fromkeys(unit.bus for unit in units):
        mine = [unit.wiring.mux for unit in units if unit.bus == bus and unit.wiring is not None]
        channels = sorted({(mux.address, mux.channel) for mux in mine if mux is not None})
        clock_hz = harness.buses[bus].clock_hz
        _add_muxes(circuit, bus, channels, clock_hz)
        _add_plug(circuit, bus, clock_hz)


def _add_expander(circuit: Circuit, unit: Unit, ends: Sequence[End]) -> None:
    wiring = unit.wiring
    if wiring is None:
        return
    chip, package = wiring.chip, wiring.chip.package
    circuit.put(unit.ref, _kind(package, chip.pins), name=unit.place)
    _add_power(circuit, unit.ref, package, wiring.address - chip.addresses[0])
    sda, scl = _wires(unit.bus, wiring.mux)
    circuit.join(sda, unit.ref, package.number("SDA"))
    circuit.join(scl, unit.ref, package.number("SCL"))
    if not chip.pulls_up:
        used = {end.pin for end in ends}
        for pin in chip.pins:
            if pin not in used:  # An input that floats draws current; these are never outputs.
                circuit.join(GROUND, unit.ref, package.number(pin))


def _add_power(circuit: Circuit, ref: str, package: Package, above: int) -> None:
    """Connect supply, ground, reset and address of a chip, so far above its lowest one."""
    for number, name in enumerate(package.pins, start=1):
        if name in GROUND_PINS:
            circuit.join(GROUND, ref, str(number))
        if name in SUPPLY_PINS:
            circuit.join(SUPPLY, ref, str(number))
            circuit.between("C", _DECOUPLING, SUPPLY, GROUND)
    for name, high in package.selects(above):
        circuit.join(SUPPLY if high else GROUND, ref, package.number(name))
    if RESET in package.pins:
        circuit.join(f"{ref}_{RESET}", ref, package.number(RESET))
        circuit.between("R", _RESET_PULL, SUPPLY, f"{ref}_{RESET}")


def _add_muxes(circuit: Circuit, bus: int, channels: Sequence[tuple[int, int]], clock_hz: int) -> None:
    for address in dict.fromkeys(address for address, _ in channels):
        ref = circuit.next("U", _kind(tca9548a.PACKAGE, ()))
        _add_power(circuit, ref, tca9548a.PACKAGE, address - tca9548a.ADDRESSES[0])
        for wire, pin in zip(_wires(bus, None), ("SDA", "SCL"), strict=True):
            circuit.join(wire, ref, tca9548a.PACKAGE.number(pin))
        for channel in (channel for at, channel in channels if at == address):
            pair = _wires(bus, MuxChannel(address=address, channel=channel))
            for wire, pin in zip(pair, (f"SD{channel}", f"SC{channel}"), strict=True):
                circuit.join(wire, ref, tca9548a.PACKAGE.number(pin))
                circuit.between("R", _pull_up(clock_hz), SUPPLY, wire)


def _add_plug(circuit: Circuit, bus: int, clock_hz: int) -> None:
    sda, scl = _wires(bus, None)
    ref = circuit.next("J", header(len(_HOST)))
    for number, net in enumerate((SUPPLY, GROUND, sda, scl), start=1):
        circuit.join(net, ref, str(number))
    circuit.between("C", _BULK, SUPPLY, GROUND)
    for wire in (sda, scl):
        circuit.between("R", _pull_up(clock_hz), SUPPLY, wire)


def _wires(bus: int, mux: MuxChannel | None) -> tuple[str, str]:
    """Return the nets of a bus, or of a channel behind it."""
    where = f"{bus}" if mux is None else f"{bus}_{mux.address:02X}_{mux.channel}"
    return f"SDA{where}", f"SCL{where}"


def _pull_up(clock_hz: int) -> Kind:
    """Return a pull-up of the bus that rises 150 pF and more in the time that its speed allows (UM10204)."""
    note = "leave it out where the host has its own"
    if clock_hz <= 100_000:
        return resistor("4k7", note)
    if clock_hz <= 400_000:
        return resistor("2k2", note)
    return resistor("1k", f"{note}; for {clock_hz} Hz, with short wires only: measure the rise time")


def _kind(package: Package, inputs: Sequence[str]) -> Kind:
    def type_of(name: str) -> str:
        if name in (*SUPPLY_PINS, *GROUND_PINS):
            return "power_in"
        return "bidirectional" if name in inputs or name[:2] in ("SD", "SC") else _TYPES.get(name, "input")

    pins = tuple((str(number), name, type_of(name)) for number, name in enumerate(package.pins, start=1))
    return Kind(
        package.part,
        "Interface_Expansion",
        package.symbol,
        package.footprint,
        pins,
        part=package.part,
        maker=package.maker,
        sure=package.sure,
        note=package.note,
    )
