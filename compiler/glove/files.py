"""The files of a spec, for cutting, sewing, soldering and running the reduced glove, and their folder."""

import io
import os
import uuid
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import msgspec

from thenar.runtime.harness.wiring import Harness
from thenar.runtime.harness.writing import harness_to_toml
from thenar.runtime.manifest import Manifest
from thenar.runtime.scanning.scanmap import ScanMap

from ..hand import HandShape
from ..publication import check_folder, entries, publish_folder
from .circuit import Circuit, Component, ComponentKind
from .lists import materials_csv, readme_of, sensors_csv, wiring_csv
from .pattern import LAYERS, Circle, Pattern, PatternLine, Shape, Text
from .spec import GloveSpec, SpecError, glove_spec

if TYPE_CHECKING:
    from ezdxf.layouts.layout import Modelspace

_SVG_NAMESPACE = "http://www.w3.org/2000/svg"
_INKSCAPE = "http://www.inkscape.org/namespaces/inkscape"
_SVG_COLOURS = {
    "outline": "#000",
    "strips": "#06c",
    "creases": "#aaa",
    "holes": "#d00",
    "names": "#333",
    "scale": "#000",
}
_STROKE_MM = 0.2
# The height of capitals in Helvetica and similar fonts, as a share of the font size.
_CAPITALS = 0.72
# AutoCAD's colour numbers: black or white, blue, grey, red.
_DXF_COLOURS = {"outline": 7, "strips": 5, "creases": 8, "holes": 1, "names": 8, "scale": 7}


def svg_of(pattern: Pattern) -> bytes:
    """Return the SVG: one user unit is one millimetre, and drawing programs show each group as a layer."""
    page, shapes = pattern
    root = ET.Element(
        "svg",
        {
            "xmlns": _SVG_NAMESPACE,
            "xmlns:inkscape": _INKSCAPE,
            "width": f"{page.width_mm:g}mm",
            "height": f"{page.height_mm:g}mm",
            "viewBox": f"0 0 {page.width_mm:g} {page.height_mm:g}",
            "font-family": "Helvetica, Arial, sans-serif",
        },
    )
    for layer in LAYERS:
        group = ET.SubElement(root, "g", _layer(layer))
        for shape in shapes:
            if shape.layer == layer:
                _add_to_svg(group, shape, page.height_mm)
    ET.indent(root, " ")
    return b'<?xml version="1.0" encoding="utf-8"?>\n' + ET.tostring(root, encoding="unicode").encode() + b"\n"


def _layer(name: str) -> dict[str, str]:
    colour = _SVG_COLOURS[name]
    paint = {"fill": colour} if name == "names" else {"fill": "none", "stroke": colour, "stroke-width": f"{_STROKE_MM}"}
    return {"id": name, "inkscape:groupmode": "layer", "inkscape:label": name, **paint}


def _add_to_svg(group: ET.Element, shape: Shape, height_mm: float) -> None:
    match shape:
        case PatternLine(points=points, closed=closed):
            places = " ".join(f"{x:.3f},{height_mm - y:.3f}" for x, y in points)
            ET.SubElement(group, "polygon" if closed else "polyline", {"points": places})
        case Circle(x=x, y=y, radius=radius):
            ET.SubElement(group, "circle", {"cx": f"{x:.3f}", "cy": f"{height_mm - y:.3f}", "r": f"{radius:g}"})
        case Text():
            _add_text(group, shape, height_mm)


def _add_text(group: ET.Element, text: Text, height_mm: float) -> None:
    baseline = text.y - text.height / 2 if text.centred else text.y
    attributes = {
        "x": f"{text.x:.3f}",
        "y": f"{height_mm - baseline:.3f}",
        "font-size": f"{text.height / _CAPITALS:.3f}",
    }
    if text.centred:
        attributes["text-anchor"] = "middle"
    ET.SubElement(group, "text", attributes).text = text.text


def dxf_of(pattern: Pattern) -> bytes:
    """Return the DXF (AutoCAD 2000, millimetres), which cutters and CAD programs read."""
    _load_ezdxf()
    from ezdxf.filemanagement import new
    from ezdxf.units import MM

    text = io.StringIO()
    with _undated():
        document = new("R2000", units=MM)
        for layer in LAYERS:
            document.layers.add(layer, color=_DXF_COLOURS[layer])
        space = document.modelspace()
        for shape in pattern[1]:
            _add_to_dxf(space, shape)
        document.write(text)
    return text.getvalue().encode(document.output_encoding, "dxfreplace")


def _load_ezdxf() -> None:
    """Import ezdxf, which then reads settings and a list of fonts in the user's home, also where that is unreadable."""
    try:
        import_module("ezdxf")
    except OSError:
        before = dict(os.environ)
        with TemporaryDirectory() as empty:
            os.environ.update(HOME=empty, XDG_CONFIG_HOME=empty, XDG_CACHE_HOME=empty)
            try:
                import_module("ezdxf")
            finally:
                os.environ.clear()
                os.environ.update(before)


def _add_to_dxf(space: "Modelspace", shape: Shape) -> None:
    from ezdxf.enums import TextEntityAlignment

    on_layer = {"layer": shape.layer}
    match shape:
        case PatternLine(points=points, closed=closed):
            space.add_lwpolyline(points.tolist(), close=closed, dxfattribs=on_layer)
        case Circle(x=x, y=y, radius=radius):
            space.add_circle((x, y), radius, dxfattribs=on_layer)
        case Text(x=x, y=y, height=height, text=text, centred=centred):
            where = TextEntityAlignment.MIDDLE_CENTER if centred else TextEntityAlignment.LEFT
            space.add_text(text, height=height, dxfattribs=on_layer).set_placement((x, y), align=where)


@contextmanager
def _undated() -> Iterator[None]:
    """Keep dates and random identifiers out of the output of ezdxf."""
    from ezdxf._options import options

    before = options.write_fixed_meta_data_for_testing
    options.write_fixed_meta_data_for_testing = True
    try:
        yield
    finally:
        options.write_fixed_meta_data_for_testing = before


_VERSION = "E"
# An arbitrary constant: identifiers must only be the same whenever the same component is written.
_NAMESPACE = uuid.UUID("5e1f3c0a-7f7a-5d0b-9a53-4d6f0b7c2e61")


def netlist_of(circuit: Circuit, title: str) -> bytes:
    """Return the netlist. It includes components off the board, marked so that KiCad leaves them out of the layout.

    It holds no date and no path: the same circuit gives the same bytes.
    """
    lines = [
        f"(export (version {_quoted(_VERSION)})",
        f'  (design (source {_quoted(title)}) (date "") (tool "thenar")',
        f'    (sheet (number "1") (name "/") (tstamps "/") (title_block (title {_quoted(title)}))))',
        "  (components",
        *(line for component in circuit.components for line in _component(component)),
        "  )",
        "  (libparts",
        *(line for kind in _symbols(circuit) for line in _libpart(kind)),
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


def _symbols(circuit: Circuit) -> list[ComponentKind]:
    """Return one kind of component for each symbol."""
    return list({(c.kind.library, c.kind.symbol): c.kind for c in circuit.components}.values())


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
        *("cutting.dxf", "cutting.svg"),
    }
)
_MARK = "spec.json"


def spec_files(
    manifest: Manifest,
    scan: ScanMap | None = None,
    harness: Harness | None = None,
    hand: HandShape | None = None,
) -> Mapping[str, bytes]:
    """Return name -> content of the files of a build's spec; the same arguments give the same bytes.

    Arguments and errors are those of `glove_spec`.
    """
    return files_of(glove_spec(manifest, scan, harness, hand))


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
    return {**files, "cutting.dxf": dxf_of(spec.pattern), "cutting.svg": svg_of(spec.pattern)}


def check_output(folder: Path) -> None:
    """Raise SpecError unless a spec may be written there: a new or empty folder, or one that holds a spec."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    check_folder(folder, users_files, SpecError)


def write_spec(files: Mapping[str, bytes], folder: Path) -> None:
    """Write the files of a spec as `folder`, replacing an older spec. Raises SpecError as `check_output` does."""
    publish_folder(files, folder, users_files, SpecError)


def users_files(folder: Path) -> list[str]:
    """Return the user's entries in the folder of a spec. Raises SpecError if it holds no spec."""
    if any(folder.iterdir()) and not (folder / _MARK).is_file():
        raise SpecError(f"{folder} exists already and is not a spec: name another folder")
    return [path for path in entries(folder) if path not in NAMES]
