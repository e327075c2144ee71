"""The files of a spec, for cutting, sewing, soldering and running the reduced glove, and their folder."""

import csv
import io
import uuid
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from textwrap import fill

import msgspec

from thenar.runtime.errors import BuildError
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.harness.writing import harness_to_toml
from thenar.runtime.manifest import Manifest
from thenar.runtime.scanning.scanmap import ScanMap

from ..hand import HandShape
from ..publication import check_folder, entries, publish_folder
from ..text import cells, sentence
from .circuit import BillLine, Circuit, Component, ComponentKind
from .layout import CONTACT_MM, counted_sensors
from .prices import Part
from .spec import GloveSpec, SpecSummary, glove_spec

Row = Sequence[object]
_WIDTH = 100
# Topics of facts that say what to expect of the glove.
_EXPECTED = ("scan", "accuracy", "caution", "faults")
# Of the netlist.
_VERSION = "E"
# An arbitrary constant: identifiers must only be the same whenever the same component is written.
_NAMESPACE = uuid.UUID("5e1f3c0a-7f7a-5d0b-9a53-4d6f0b7c2e61")


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
        ("quantity", "unit", "what", "part_number", "maker", "footprint", "designators", "confirmed", "note", "price"),
        (
            (
                *(f"{m.quantity:g}", m.unit, m.what, m.part, m.maker, m.footprint, " ".join(m.designators)),
                *("yes" if m.sure else "no", m.note, "" if m.price is None else m.price),
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
    parts += [
        "Please note",
        "Supply all chips and pull-ups with the voltage of the host's bus: 3.3 V on a Raspberry Pi.",
    ]
    if any(sensor.kind == "switch" for sensor in summary.sensors):
        parts.append("A contact bounces for up to 3 ms when it closes and 8 ms when it opens: thenar debounces.")
    parts += [*summary.remarks, *doubts]
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
            f"cutting.svg is the glove of your layout, {printed} Layers: outline, holes (one for each "
            "sensor), names, scale."
        )
        yield "sensors.csv: every wired sensor with its position, as in your layout, and its pin."
        return
    yield (
        f"cutting.svg is the right hand of {summary.hand_length_mm:g} mm length laid flat, the palm "
        f"up, {printed} For a left hand, mirror it. Layers: outline, strips (the sides of the digits, unfolded), "
        f"creases, holes ({CONTACT_MM} mm, where the sensor meets the hand), names, scale."
    )
    yield (
        "The pattern is a map: lengths along the digits are true; the digits are spread and the palm is broader "
        "than the hand, to leave room for the strips. Fit the cloth to the hand, and place the sensors by the "
        "creases of the joints."
    )
    yield "sensors.csv: every wired sensor with its position, measured from the middle of the wrist, and its pin."


def netlist_of(circuit: Circuit, title: str) -> bytes:
    """Return the netlist. It includes components off the board, marked so that KiCad leaves them out of the layout.

    It holds no date and no path: the same circuit gives the same bytes.
    """
    kinds = {(each.kind.library, each.kind.symbol): each.kind for each in circuit.components}
    lines = [
        f"(export (version {_quoted(_VERSION)})",
        f'  (design (source {_quoted(title)}) (date "") (tool "thenar")',
        f'    (sheet (number "1") (name "/") (tstamps "/") (title_block (title {_quoted(title)}))))',
        "  (components",
        *(line for component in circuit.components for line in _component(component)),
        "  )",
        "  (libparts",
        *(line for kind in kinds.values() for line in _libpart(kind)),
        "  )",
        "  (libraries)",
        "  (nets",
        *_nets(circuit),
        "  ))",
    ]
    return ("\n".join(lines) + "\n").encode()


def _component(component: Component) -> Iterator[str]:
    kind = component.kind
    yield f"    (comp (ref {_quoted(component.ref)})"
    yield f"      (value {_quoted(component.name if component.name and not kind.part else kind.value)})"
    if kind.footprint:
        yield f"      (footprint {_quoted(kind.footprint)})"
    fields = {"MPN": kind.part, "Manufacturer": kind.maker, "Place": component.name}
    given = [f"(field (name {_quoted(name)}) {_quoted(value)})" for name, value in fields.items() if value]
    if given:
        yield f"      (fields {' '.join(given)})"
    yield f'      (libsource (lib {_quoted(kind.library)}) (part {_quoted(kind.symbol)}) (description ""))'
    if not component.on_board:
        yield '      (property (name "exclude_from_board"))'
    yield '      (sheetpath (names "/") (tstamps "/"))'
    yield f"      (tstamps {_quoted(str(uuid.uuid5(_NAMESPACE, component.ref)))}))"


def _libpart(kind: ComponentKind) -> Iterator[str]:
    yield f"    (libpart (lib {_quoted(kind.library)}) (part {_quoted(kind.symbol)})"
    yield "      (pins"
    for number, name, electrical in kind.pins:
        yield f"        (pin (num {_quoted(number)}) (name {_quoted(name)}) (type {_quoted(electrical)}))"
    yield "      ))"


def _nets(circuit: Circuit) -> Iterator[str]:
    pins = {c.ref: {number: (name, kind) for number, name, kind in c.kind.pins} for c in circuit.components}
    for code, (net, nodes) in enumerate(circuit.nets.items(), start=1):
        yield f'    (net (code "{code}") (name {_quoted(net)})'
        for ref, pin in nodes:
            name, electrical = pins[ref][pin]
            yield (
                f"      (node (ref {_quoted(ref)}) (pin {_quoted(pin)}) "
                f"(pinfunction {_quoted(name)}) (pintype {_quoted(electrical)}))"
            )
        yield "    )"


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


# All files that a spec may contain.
NAMES = frozenset(
    {
        *("README.txt", "bom.csv", "glove.net", "glove.toml", "sensors.csv", "spec.json", "wiring.csv"),
        "cutting.svg",
    }
)
_MARK = "spec.json"


def spec_files(
    manifest: Manifest,
    scan: ScanMap | None = None,
    harness: Harness | None = None,
    hand: HandShape | None = None,
    parts: Mapping[str, Part] | None = None,
) -> Mapping[str, bytes]:
    """Return name -> content of the files of a build's spec; the same arguments give the same bytes.

    Arguments and errors are those of `glove_spec`.
    """
    return files_of(glove_spec(manifest, scan, harness, hand, parts))


def files_of(spec: GloveSpec) -> Mapping[str, bytes]:
    """Return name -> content of a spec's files; without a cutting pattern if the switch positions are unknown."""
    summary = spec.summary
    files = {
        "README.txt": readme_of(spec).encode(),
        "bom.csv": materials_csv(summary.materials),
        "glove.net": netlist_of(spec.circuit, summary.glove),
        "glove.toml": harness_to_toml(spec.harness).encode(),
        "spec.json": msgspec.json.format(msgspec.json.encode(summary), indent=2) + b"\n",
        "sensors.csv": sensors_csv(summary),
        "wiring.csv": wiring_csv(summary),
    }
    if spec.pattern is None:
        return files
    return {**files, "cutting.svg": spec.pattern[1]}


def check_output(folder: Path) -> None:
    """Raise BuildError unless a spec may be written there: a new or empty folder, or one that holds a spec."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    check_folder(folder, users_files, BuildError)


def write_spec(files: Mapping[str, bytes], folder: Path) -> None:
    """Write the files of a spec as `folder`, replacing an older spec. Raises BuildError as `check_output` does."""
    publish_folder(files, folder, users_files, BuildError)


def users_files(folder: Path) -> list[str]:
    """Return the user's entries in the folder of a spec. Raises BuildError if it holds no spec."""
    if any(folder.iterdir()) and not (folder / _MARK).is_file():
        raise BuildError(f"{folder} exists already and is not a spec: name another folder")
    return [path for path in entries(folder) if path not in NAMES]
