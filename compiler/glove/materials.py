"""The bill of materials: what to buy, how many, for which designators."""

from collections.abc import Iterator, Sequence

from msgspec import Struct

from .circuit import Circuit, Kind, grouped
from .wires import Wire

_ESTIMATE = "an estimate: straight ways and a quarter more, and 40 mm for the ends"
_STRANDED = "stranded wire, AWG 30 or thinner, flexible"


class Material(Struct, frozen=True):
    """A line of the bill: `part` is an orderable part number of `maker`, empty unless it is known.

    sure is False where part or footprint is not confirmed twice: compare with the data sheet before ordering.
    quantity counts pieces, or metres where `unit` is "m".
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


def bill_of(circuit: Circuit, wires: Sequence[Wire]) -> tuple[Material, ...]:
    """Return the bill of a glove's circuit and of the wires in it."""
    pieces = [_pieces(kind, refs) for kind, refs in grouped(circuit.components)]
    return (*pieces, *_wire_lines(wires))


def _pieces(kind: Kind, refs: Sequence[str]) -> Material:
    what = {"Device": f"{_named(kind)} {kind.value}", "Connector_Generic": f"header or holes, {kind.value}"}
    return Material(
        quantity=len(refs),
        unit="pcs",
        what=what.get(kind.library, kind.value),
        part=kind.part,
        maker=kind.maker,
        footprint=kind.footprint,
        designators=tuple(refs),
        sure=kind.sure,
        note=kind.note,
    )


def _named(kind: Kind) -> str:
    return {"R": "resistor", "C": "ceramic capacitor"}.get(kind.symbol, "diode")


def _wire_lines(wires: Sequence[Wire]) -> Iterator[Material]:
    colours: dict[str, list[Wire]] = {}
    for wire in wires:
        colours.setdefault(wire.colour.partition(",")[0], []).append(wire)
    for colour, group in colours.items():
        lengths = [wire.length_mm for wire in group if wire.length_mm is not None]
        refs = tuple(dict.fromkeys(wire.connector for wire in group))
        if lengths:
            yield Material(sum(lengths) / 1000, "m", f"{_STRANDED}, {colour}", "", "", "", refs, True, _ESTIMATE)
