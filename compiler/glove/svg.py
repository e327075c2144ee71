"""A pattern as SVG: one user unit is one millimetre, and every layer is a group that drawing programs show as one."""

import xml.etree.ElementTree as ET

from .pattern import LAYERS, Circle, Line, Pattern, Shape, Text

_NAMESPACE = "http://www.w3.org/2000/svg"
_INKSCAPE = "http://www.inkscape.org/namespaces/inkscape"
_COLOURS = {"outline": "#000", "strips": "#06c", "creases": "#aaa", "holes": "#d00", "names": "#333", "scale": "#000"}
_STROKE_MM = 0.2
# The height of capitals in Helvetica and its kin, as a share of the size of the type.
_CAPITALS = 0.72


def svg_of(pattern: Pattern) -> bytes:
    """Return the drawing; the same pattern gives the same bytes."""
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
                _add(group, shape, page.height_mm)
    ET.indent(root, " ")
    return b'<?xml version="1.0" encoding="utf-8"?>\n' + ET.tostring(root, encoding="unicode").encode() + b"\n"


def _layer(name: str) -> dict[str, str]:
    colour = _COLOURS[name]
    paint = {"fill": colour} if name == "names" else {"fill": "none", "stroke": colour, "stroke-width": f"{_STROKE_MM}"}
    return {"id": name, "inkscape:groupmode": "layer", "inkscape:label": name, **paint}


def _add(group: ET.Element, shape: Shape, height_mm: float) -> None:
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
