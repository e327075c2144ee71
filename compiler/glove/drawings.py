"""A pattern as SVG and as DXF, every shape on the layer that it names; the same pattern gives the same bytes."""

import io
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from .pattern import LAYERS, Circle, Line, Pattern, Shape, Text

if TYPE_CHECKING:
    from ezdxf.layouts.layout import Modelspace

_NAMESPACE = "http://www.w3.org/2000/svg"
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
# The height of capitals in Helvetica and its kin, as a share of the size of the type.
_CAPITALS = 0.72
# AutoCAD's colour numbers: black or white, blue, grey, red.
_DXF_COLOURS = {"outline": 7, "strips": 5, "creases": 8, "holes": 1, "names": 8, "scale": 7}


def svg_of(pattern: Pattern) -> bytes:
    """Return the SVG: one user unit is one millimetre, and drawing programs show each group as a layer."""
    page = pattern.page
    root = ET.Element(
        "svg",
        {
            "xmlns": _NAMESPACE,
            "xmlns:inkscape": _INKSCAPE,
            "width": f"{page.width_mm:g}mm",
            "height": f"{page.height_mm:g}mm",
            "viewBox": f"0 0 {page.width_mm:g} {page.height_mm:g}",
            "font-family": "Helvetica, Arial, sans-serif",
        },
    )
    for layer in LAYERS:
        group = ET.SubElement(root, "g", _layer(layer))
        for shape in pattern.shapes:
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
        case Line(points=points, closed=closed):
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
    """Return the DXF of AutoCAD 2000 in millimetres, which cutters and CAD programs read."""
    from ezdxf.filemanagement import new
    from ezdxf.units import MM

    text = io.StringIO()
    with _undated():
        document = new("R2000", units=MM)
        for layer in LAYERS:
            document.layers.add(layer, color=_DXF_COLOURS[layer])
        space = document.modelspace()
        for shape in pattern.shapes:
            _add_to_dxf(space, shape)
        document.write(text)
    return text.getvalue().encode(document.output_encoding, "dxfreplace")


def _add_to_dxf(space: "Modelspace", shape: Shape) -> None:
    from ezdxf.enums import TextEntityAlignment

    on_layer = {"layer": shape.layer}
    match shape:
        case Line(points=points, closed=closed):
            space.add_lwpolyline(points.tolist(), close=closed, dxfattribs=on_layer)
        case Circle(x=x, y=y, radius=radius):
            space.add_circle((x, y), radius, dxfattribs=on_layer)
        case Text(x=x, y=y, height=height, text=text, centred=centred):
            where = TextEntityAlignment.MIDDLE_CENTER if centred else TextEntityAlignment.LEFT
            space.add_text(text, height=height, dxfattribs=on_layer).set_placement((x, y), align=where)


@contextmanager
def _undated() -> Iterator[None]:
    """Keep dates and random identifiers out of what ezdxf writes."""
    from ezdxf._options import options

    before = options.write_fixed_meta_data_for_testing
    options.write_fixed_meta_data_for_testing = True
    try:
        yield
    finally:
        options.write_fixed_meta_data_for_testing = before
