"""The lists of a spec: switches, wires and materials as CSV, and README.txt."""

import csv
import io
from collections.abc import Iterable, Iterator, Sequence
from textwrap import fill

from ..text import cells
from .circuit import BillLine
from .layout import CONTACT_MM
from .spec import Expected, SpecSummary

Row = Sequence[object]
_WIDTH = 100


def switches_csv(summary: SpecSummary) -> bytes:
    """Return the switches with their positions on the hand and their readers."""
    pins = {
        switch: (reader, pin)
        for reader in summary.readers
        for switch, pin in zip(reader.switches, reader.pins, strict=True)
    }
    return _csv(
        ("switch", "name", "part", "side", "x_mm", "y_mm", "read_by", "place", "pin"),
        (
            (f"SW{s.number}", s.name, s.part, s.side, s.x_mm, s.y_mm, reader.ref, reader.place, pin)
            for s in summary.switches
            for reader, pin in (pins[s.number],)
        ),
    )


def wiring_csv(summary: SpecSummary) -> bytes:
    """Return every wire from the switches to the connectors at the wrist, and on to its reader."""
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


def readme_of(summary: SpecSummary) -> str:
    """Return the text of README.txt."""
    parts = [f"{summary.glove}: a glove of {len(summary.switches)} switches", *_building(summary)]
    parts += ["What to expect", *expectations(summary.expected)]
    doubts = [f"{m.part or m.what}: {m.note}" for m in summary.materials if not m.sure]
    parts += ["Please note", *_advice(), *summary.remarks, *doubts]
    headings = {parts[0], "To cut and sew", "To wire", "To solder", "To run", "What to expect", "Please note"}
    return "\n".join(_laid_out(part, part in headings) for part in parts)


def expectations(expected: Expected) -> Iterator[str]:
    """Yield sentences on times and accuracy."""
    if expected.transactions:
        full = "" if expected.full_us == expected.scan_us else f"; for all wired switches, {expected.full_us:.1f} us"
        yield (
            f"A whole scan takes {expected.scan_us:.1f} us on the wire, in {expected.transactions} "
            f"transaction{'s' if expected.transactions > 1 else ''}{full}. thenar doctor measures what the "
            "computer adds to each of them."
        )
    for us in expected.boards_us:
        yield f"A scanner board's keys and kept taxels take {us:.0f} us to convert and send."
    if expected.glove_us is not None:
        yield (
            f"The CyberGlove sends a record of {expected.sensors} sensors every {expected.glove_us:.0f} us at best, by "
            "the vendor's formula or as measured in glove.toml."
        )
    for rate in sorted(expected.rates, key=lambda rate: rate.protocol == "training"):
        yield f"Accuracy, {rate}."
    for each in expected.detection:
        if each.held.protocol != "training":
            yield f"Nothing held, {each}."
    for sentence in () if expected.faults is None else expected.faults.sentences:
        yield f"At worst, on the training rows: {sentence}."


def _building(summary: SpecSummary) -> Iterator[str]:
    if summary.print_on:
        yield "To cut and sew"
        yield from _cutting(summary)
    yield "To wire"
    yield (
        "wiring.csv: a bundle of wires for each digit, and in it a wire for contact 1 of every switch and a common "
        "return for contact 2, from switch to switch. Colours count the wires of a bundle; marks distinguish a "
        "colour's second use from its first. Lengths are estimates: the straight distance to the wrist and a "
        "quarter more."
    )
    yield "To solder"
    yield (
        "bom.csv: what to buy. glove.net: the circuit for the board at the wrist; in KiCad's board editor, File, "
        "Import, Netlist. The switches are in it with their connections and are left off the board. A part number "
        "is given only where it is known."
    )
    for reader in summary.readers:
        yield f"{reader.ref}: {reader.place}, {len(reader.switches)} switches."
    yield "To run"
    yield (
        "glove.toml: the wiring as thenar run, record, emulate and doctor read it. Device files and ports are the "
        "lines to check. spec.json: all of this for machines."
    )


def _cutting(summary: SpecSummary) -> Iterator[str]:
    printed = f"at 1:1 in millimetres, for {summary.print_on}. Print without scaling and measure the bar of 50 mm."
    if summary.hand_length_mm is None:
        yield (
            f"cutting.svg and cutting.dxf are the glove of your layout, {printed} Layers: outline, holes (one for each "
            "switch), names, scale."
        )
        yield "switches.csv: every switch with its position, as in your layout, and its pin."
        return
    yield (
        f"cutting.svg and cutting.dxf are the right hand of {summary.hand_length_mm:g} mm length laid flat, the palm "
        f"up, {printed} For a left hand, mirror it. Layers: outline, strips (the sides of the digits, unfolded), "
        f"creases, holes ({CONTACT_MM} mm, where the switch's disc meets the hand), names, scale."
    )
    yield (
        "The pattern is a map: lengths along the digits are true; the digits are spread and the palm is broader "
        "than the hand, to leave room for the strips. Fit the cloth to the hand, and place the switches by the "
        "creases of the joints."
    )
    yield "switches.csv: every switch with its position, measured from the middle of the wrist, and its pin."


def _advice() -> Iterator[str]:
    yield "Supply all chips and pull-ups with the voltage of the host's bus: 3.3 V on a Raspberry Pi."
    yield "A contact bounces for up to 3 ms when it closes and 8 ms when it opens: thenar debounces."


def _laid_out(part: str, heading: bool) -> str:
    if heading:
        return f"{part}\n{'-' * len(part)}\n"
    return fill(part, _WIDTH) + "\n"
