"""The circuit of a glove: switches, bundles' connectors, boards and diodes, and the expanders with what they need."""

from collections.abc import Sequence

from thenar.runtime.harness.wiring import Harness

from .circuit import Circuit, Kind, Node, header, resistor, two_pins
from .ends import GROUND, SUPPLY, End, Unit
from .expanders import add_expanders
from .placing import PlacedSwitch
from .wires import Wire, net_of

_SWITCH = Kind(
    "EVQPLDA15",
    "Switch",
    "SW_Push",
    "Button_Switch_SMD:SW_SPST_Panasonic_EVQPL_3PL_5PL_PT_A15",
    two_pins(("1", "2")),
    part="EVQPLDA15",
    maker="Panasonic",
    note="light touch switch, 4.9 x 4.9 x 1.5 mm; that its operating force is 1.0 N is not confirmed by a data sheet",
)
_DIODE = Kind(
    "Schottky, 30 V",
    "Device",
    "D_Schottky",
    "Diode_SMD:D_SOD-323_HandSoldering",
    (("1", "K", "passive"), ("2", "A", "passive")),
    note="such as a BAT54 of this package; at 5 V a 1N4148 will do",
)
# What wins against a chip's own pull-ups of 40 uA and more, and what pulls an input that has nothing of its own.
_PULL_DOWN = resistor("4k7", "pulls an input down, against the chip's own pull-up")
_PULL_UP = resistor("10k", "pulls up an input of a chip that has no pull-ups")


def glove_circuit(
    switches: Sequence[PlacedSwitch], ends: Sequence[End], wires: Sequence[Wire], harness: Harness
) -> Circuit:
    """Return the circuit in which switch n of the build is SWn and reaches its `end` through its bundle's connector."""
    circuit = Circuit()
    for switch in switches:
        circuit.put(f"SW{switch.number}", _SWITCH, on_board=False, name=switch.name)
    _add_connectors(circuit, wires)
    units = _units(ends)
    for unit in units:
        if unit.wiring is None:
            _add_board(circuit, [end for end in ends if end.unit == unit])
    for end in ends:
        _add_signal(circuit, end, switches[end.switch])
    add_expanders(circuit, [unit for unit in units if unit.wiring is not None], ends, harness)
    return circuit


def _add_connectors(circuit: Circuit, wires: Sequence[Wire]) -> None:
    bundles: dict[tuple[str, str], list[Wire]] = {}
    for wire in wires:
        bundles.setdefault((wire.connector, wire.bundle), []).append(wire)
    for (ref, bundle), group in bundles.items():
        circuit.put(ref, header(len(group)), name=f"{bundle} bundle")
        for wire in group:
            circuit.join(wire.net, ref, str(wire.pin))


def _add_board(circuit: Circuit, ends: Sequence[End]) -> None:
    """Put in a scanner board: a pin for every pin of its own that a kept switch needs, and one for ground."""
    signals = {end.pad: end.pin for end in ends}
    nets = dict.fromkeys([*(end.other for end in ends), GROUND])
    named = {**signals, **{str(number): net for number, net in enumerate(nets, start=len(signals) + 1)}}
    pins = tuple((pad, name, "bidirectional") for pad, name in named.items())
    unit = ends[0].unit
    circuit.put(unit.ref, Kind("scanner board", "thenar", f"board_{unit.ref}", "", pins), on_board=False)
    for number, net in enumerate(nets, start=len(signals) + 1):
        circuit.join(net, unit.ref, str(number))
    if unit.diodes:
        for pad, name in signals.items():
            circuit.join(f"{unit.ref}_{name}", unit.ref, pad)


def _add_signal(circuit: Circuit, end: End, switch: PlacedSwitch) -> None:
    net = net_of(end, switch)
    circuit.join(net, f"SW{switch.number}", "1")
    circuit.join(end.other, f"SW{switch.number}", "2")
    if end.unit.diodes:
        circuit.between("D", _DIODE, net, f"{end.unit.ref}_{end.pin}")
        return
    if Node(end.unit.ref, end.pad) not in circuit.nets[net]:
        circuit.join(net, end.unit.ref, end.pad)
    _add_pull(circuit, end, net)


def _add_pull(circuit: Circuit, end: End, net: str) -> None:
    wiring = end.unit.wiring
    if wiring is None:
        return
    if end.other == SUPPLY:
        circuit.between("R", _PULL_DOWN, net, GROUND)
    elif not wiring.chip.pulls_up:
        circuit.between("R", _PULL_UP, net, SUPPLY)


def _units(ends: Sequence[End]) -> list[Unit]:
    """Return what reads switches: the boards, then the expanders, by their numbers."""
    return sorted({end.unit.ref: end.unit for end in ends}.values(), key=lambda unit: (unit.ref[0], int(unit.ref[1:])))
