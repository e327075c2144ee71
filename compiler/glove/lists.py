"""The lists of a spec: switches, wires and materials as CSV, and README.txt."""

import csv
import io
from collections.abc import Iterable, Iterator, Sequence
from textwrap import fill

from ..text import cells, sentence
from .circuit import BillLine
from .layout import CONTACT_MM, counted_sensors
from .spec import GloveSpec, SpecSummary

Row = Sequence[object]
_WIDTH = 100
# Topics of facts that say what to expect of the glove.
_EXPECTED = ("scan", "accuracy", "caution", "faults")


def sensors_csv(summary: SpecSummary) -> bytes:
    """Return the wired sensors with their positions on the hand and their readers."""
    pins = {
        switch: (reader, pin)
        for reader in summary.readers
        for switch, pin in zip(reader.switches, reader.pins, strict=True)
    }
    return _csv(
        ("sensor", "kind", "name", "part", "side", "x_mm", "y_mm", "read_by", "place", "pin"),
        (
            (s.ref, s.kind, s.name, s.part, s.side, s.x_mm, s.y_mm, reader.ref, reader.place, pin)
            for s in summary.sensors
            for reader, pin in (pins[s.number],)
        ),
    )


def wiring_csv(summary: SpecSummary) -> bytes:
    """Return every wire from the sensors to the connectors at the wrist, and on to its reader."""
    return _csv(
        ("bundle", "connector", "pin", "colour", "length_mm", "sensors", "contact", "net", "read_by", "input"),
        (
            (
                *(w.bundle, w.connector, w.pin, w.colour, w.length_mm),
                " ".join(summary.sensors[number - 1].ref for number in w.switches),
                *(1 if w.unit else 2, w.net, w.unit, w.input),
            )
            for w in summary.wires
        ),
    )


def materials_csv(materials: Sequence[BillLine]) -> bytes:
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


def _csv(header: Sequence[str], rows: Iterable[Row]) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(map(cells, rows))
    return text.getvalue().encode()


def readme_of(spec: GloveSpec) -> str:
    """Return the text of README.txt."""
    summary = spec.summary
    parts = [f"{summary.glove}: a glove with {summary.kept}", *_building(summary)]
    parts += ["What to expect", *expectations(spec)]
    doubts = [f"{m.part or m.what}: {m.note}" for m in summary.materials if not m.sure]
    parts += ["Please note", *_advice(summary), *summary.remarks, *doubts]
    headings = {parts[0], "To cut and sew", "To wire", "To solder", "To run", "What to expect", "Please note"}
    laid_out = (f"{part}\n{'-' * len(part)}\n" if part in headings else fill(part, _WIDTH) + "\n" for part in parts)
    return "\n".join(laid_out)


def expectations(spec: GloveSpec) -> Iterator[str]:
    """Yield sentences on times and accuracy."""
    return (sentence(str(fact)) for fact in spec.facts if fact.topic in _EXPECTED)


def _building(summary: SpecSummary) -> Iterator[str]:
    if summary.print_on:
        yield "To cut and sew"
        yield from _cutting(summary)
    yield "To wire"
    yield (
        "wiring.csv: a bundle of wires for each digit, and in it a wire for contact 1 of every sensor and a common "
        "return for contact 2, from sensor to sensor. Colours count the wires of a bundle; marks distinguish a "
        "colour's second use from its first. Lengths are estimates: the straight distance to the wrist and a "
        "quarter more."
    )
    yield "To solder"
    yield (
        "bom.csv: what to buy. glove.net: the circuit for the board at the wrist; in KiCad's board editor, File, "
        "Import, Netlist. The sensors are in it with their connections and are left off the board. A part number "
        "is given only where it is known. The sensors of joints are in bom.csv alone."
    )
    for reader in summary.readers:
        yield f"{reader.ref}: {reader.place}, {counted_sensors([summary.sensors[n - 1] for n in reader.switches])}."
    yield "To run"
    yield (
        "glove.toml: the wiring as thenar run, record, emulate and doctor read it. Device files and ports are the "
        "lines to check. thenar doctor measures what the computer adds to each transaction. spec.json: all of this for "
        "machines."
    )


def _cutting(summary: SpecSummary) -> Iterator[str]:
    printed = f"at 1:1 in millimetres, for {summary.print_on}. Print without scaling and measure the bar of 50 mm."
    if summary.hand_length_mm is None:
        yield (
            f"cutting.svg and cutting.dxf are the glove of your layout, {printed} Layers: outline, holes (one for each "
            "sensor), names, scale."
        )
        yield "sensors.csv: every wired sensor with its position, as in your layout, and its pin."
        return
    yield (
        f"cutting.svg and cutting.dxf are the right hand of {summary.hand_length_mm:g} mm length laid flat, the palm "
        f"up, {printed} For a left hand, mirror it. Layers: outline, strips (the sides of the digits, unfolded), "
        f"creases, holes ({CONTACT_MM} mm, where the sensor meets the hand), names, scale."
    )
    yield (
        "The pattern is a map: lengths along the digits are true; the digits are spread and the palm is broader "
        "than the hand, to leave room for the strips. Fit the cloth to the hand, and place the sensors by the "
        "creases of the joints."
    )
    yield "sensors.csv: every wired sensor with its position, measured from the middle of the wrist, and its pin."


def _advice(summary: SpecSummary) -> Iterator[str]:
    yield "Supply all chips and pull-ups with the voltage of the host's bus: 3.3 V on a Raspberry Pi."
    if any(sensor.kind == "switch" for sensor in summary.sensors):
        yield "A contact bounces for up to 3 ms when it closes and 8 ms when it opens: thenar debounces."
