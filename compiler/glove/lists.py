"""The lists of a spec as CSV: switches, wiring, materials."""

import csv
import io
from collections.abc import Iterable, Sequence

from ..recordings.spreadsheet import cells
from .glove_spec import Summary
from .materials import Material

Row = Sequence[object]


def switches_csv(summary: Summary) -> bytes:
    """Return the switches with their places on the hand, and what reads each."""
    pins = {switch: (reader, pin) for reader in summary.readers for switch, pin in _pairs(reader.switches, reader.pins)}
    return _csv(
        ("switch", "name", "part", "side", "x_mm", "y_mm", "read_by", "place", "pin"),
        (
            (f"SW{s.number}", s.name, s.part, s.side, s.x_mm, s.y_mm, reader.ref, reader.place, pin)
            for s in summary.switches
            for reader, pin in (pins[s.number],)
        ),
    )


def wiring_csv(summary: Summary) -> bytes:
    """Return every wire from the switches to the connectors at the wrist, and on to what reads it."""
    return _csv(
        ("bundle", "connector", "pin", "colour", "length_mm", "switches", "contact", "net", "read_by", "input"),
        (
            (
                *(w.bundle, w.connector, w.pin, w.colour, w.length_mm, " ".join(f"SW{n}" for n in w.switches)),
                *(1 if w.unit else 2, w.net, w.unit, w.input),
            )
            for w in summary.wires
        ),
    )


def materials_csv(materials: Sequence[Material]) -> bytes:
    """Return the bill of materials."""
    return _csv(
        ("quantity", "unit", "what", "part_number", "maker", "footprint", "designators", "confirmed", "note"),
        (
            (
                *(f"{m.quantity:g}", m.unit, m.what, m.part, m.maker, m.footprint, " ".join(m.designators)),
                *("yes" if m.sure else "no", m.note),
            )
            for m in materials
        ),
    )


def _pairs(switches: Sequence[int], pins: Sequence[str]) -> Iterable[tuple[int, str]]:
    return zip(switches, pins, strict=True)


def _csv(header: Sequence[str], rows: Iterable[Row]) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(map(cells, rows))
    return text.getvalue().encode()
