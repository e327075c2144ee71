"""A spec as tables: switches, bundles of wire, materials, and what to expect."""

from typing import TYPE_CHECKING

from .common import out

if TYPE_CHECKING:
    from thenar.compiler.glove.spec import SpecSummary


def print_spec(spec: "SpecSummary") -> None:
    """Print what `spec.json` holds, for people."""
    from thenar.compiler.glove.lists import expectations

    console = out()
    hand = "" if spec.hand_length_mm is None else f", for a right hand of {spec.hand_length_mm:g} mm"
    wired = "a proposed wiring" if spec.proposed else f"wired as {spec.glove}"
    console.print(f"{len(spec.switches)} switches, {wired}{hand}")
    _print_switches(spec)
    _print_wires(spec)
    _print_materials(spec)
    if spec.print_on:
        console.print(f"the pattern is for {spec.print_on}")
    for sentence in (*expectations(spec.expected), *spec.remarks):
        console.print(sentence)


def _print_switches(spec: "SpecSummary") -> None:
    from rich.table import Table

    pins = {
        n: f"{reader.ref} {pin}" for reader in spec.readers for n, pin in zip(reader.switches, reader.pins, strict=True)
    }
    table = Table("switch", "name", "part", "side", "x, mm", "y, mm", "read by", title="Switches")
    for switch in spec.switches:
        place = ("", "") if switch.x_mm is None or switch.y_mm is None else (f"{switch.x_mm:.1f}", f"{switch.y_mm:.1f}")
        number = f"SW{switch.number}"
        table.add_row(number, switch.name, switch.part or "", switch.side or "", *place, pins[switch.number])
    out().print(table)
    for reader in spec.readers:
        out().print(f"{reader.ref}: {reader.place}, {len(reader.switches)} switches")


def _print_wires(spec: "SpecSummary") -> None:
    from rich.table import Table

    table = Table("bundle", "connector", "signals", "returns", "wire, m", title="Bundles")
    for connector in dict.fromkeys(wire.connector for wire in spec.wires):
        wires = [wire for wire in spec.wires if wire.connector == connector]
        signals = sum(bool(wire.unit) for wire in wires)
        lengths = [wire.length_mm for wire in wires if wire.length_mm is not None]
        metres = f"{sum(lengths) / 1000:.2f}" if lengths else ""
        table.add_row(wires[0].bundle, connector, str(signals), str(len(wires) - signals), metres)
    out().print(table)


def _print_materials(spec: "SpecSummary") -> None:
    from rich.table import Table

    table = Table("quantity", "what", "part number", "note", title="Materials")
    for line in spec.materials:
        part = line.part if line.sure else f"{line.part} (not confirmed)"
        table.add_row(f"{line.quantity:g} {line.unit}", line.what, part, line.note)
    out().print(table)
