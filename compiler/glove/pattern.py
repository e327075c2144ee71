"""The cutting pattern: the flat hand with its kept switches as shapes on a page, in millimetres at 1:1.

Page coordinates: x to the right, y up, from the lower left corner. The page is the smallest sheet that holds it.
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..hand import HandShape
from .layout import PlacedSensor, hole_mm

# The margin that most printers leave white.
MARGIN_MM = 5.0
_A4_MM = (210.0, 297.0)
_SHEETS = (("A4", *_A4_MM), ("A3", 297.0, 420.0), ("A2", 420.0, 594.0), ("A1", 594.0, 841.0), ("A0", 841.0, 1189.0))
Floats = NDArray[np.float64]
LAYERS = ("outline", "strips", "creases", "holes", "names", "scale")
SCALE_BAR_MM = 50.0
_TITLE_MM, _TEXT_MM, _ROW_MM, _COLUMN_MM = 3.5, 2.0, 3.2, 48.0
_BAR_ROOM_MM, _GAP_MM = 14.0, 4.0
_TICK_MM = 2.0
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


@dataclass(frozen=True, slots=True)
class Page:
    """A sheet; `name` is empty if no common one is large enough."""

    name: str
    width_mm: float
    height_mm: float

    @property
    def hint(self) -> str:
        """What to print it on, in words."""
        if self.name == "A4":
            return "one A4 sheet"
        across, down = (_tiles(self.width_mm, _A4_MM[0]), _tiles(self.height_mm, _A4_MM[1]))
        size = f"{self.name or 'a sheet'} ({self.width_mm:g} x {self.height_mm:g} mm)"
        return f"{size}, or {across * down} A4 sheets, {across} across and {down} down, as a poster without scaling"


def page_for(width_mm: float, height_mm: float) -> Page:
    """Return the smallest sheet, upright or landscape, that holds a drawing of this size with a margin."""
    wide, high = width_mm + 2 * MARGIN_MM, height_mm + 2 * MARGIN_MM
    for name, short, long in _SHEETS:
        for across, up in ((short, long), (long, short)):
            if wide <= across and high <= up:
                return Page(name, across, up)
    return Page("", wide, high)


def _tiles(length_mm: float, sheet_mm: float) -> int:
    return int(-(-length_mm // (sheet_mm - 2 * MARGIN_MM)))


@dataclass(frozen=True, slots=True, eq=False)
class PatternLine:
    """A line through points (k, 2), back to the first one if `closed`."""

    layer: str
    points: Floats
    closed: bool


@dataclass(frozen=True, slots=True)
class Circle:
    """A circle."""

    layer: str
    x: float
    y: float
    radius: float


@dataclass(frozen=True, slots=True)
class Text:
    """A line of text with capitals `height` mm high: (x, y) is its start, or its middle if `centred`."""

    layer: str
    x: float
    y: float
    height: float
    text: str
    centred: bool = False


Shape = PatternLine | Circle | Text
Pattern = tuple[Page, tuple[Shape, ...]]


def pattern_of(switches: Sequence[PlacedSensor], hand: HandShape, title: str) -> Pattern:
    """Return the pattern: title, hand, a bar of 50 mm to check the print, and the list of switches below."""
    extent = np.concatenate([hand.outline, *hand.strips, hand.labels, hand.places])
    low, high = extent.min(axis=0), extent.max(axis=0)
    columns = max(1, int((high[0] - low[0]) // _COLUMN_MM))
    rows = -(-len(switches) // columns)
    below = rows * _ROW_MM + _GAP_MM + _BAR_ROOM_MM
    width = float(max(high[0] - low[0], columns * _COLUMN_MM))
    page = page_for(width, float(high[1] - low[1]) + below + 2 * _GAP_MM + _TITLE_MM)
    left = (page.width_mm - width) / 2
    move = np.array([left - low[0], MARGIN_MM + below - low[1]])
    top = page.height_mm - MARGIN_MM - _TITLE_MM
    shapes = (
        Text("names", MARGIN_MM, top, _TITLE_MM, title),
        *_hand(hand, move),
        *_holes(switches, move, hole_mm(hand)),
        *_bar(left, MARGIN_MM + rows * _ROW_MM + _GAP_MM),
        *_legend(switches, rows, left),
    )
    return page, shapes


def _hand(hand: HandShape, move: Floats) -> Iterator[Shape]:
    if len(hand.outline):
        yield PatternLine("outline", hand.outline + move, closed=True)
    yield from (PatternLine("strips", strip + move, closed=True) for strip in hand.strips)
    yield from (PatternLine("creases", crease + move, closed=False) for crease in hand.creases)
    for name, (x, y) in zip(hand.part_names, hand.labels + move, strict=False):
        yield Text("names", float(x), float(y), _TEXT_MM, name, centred=True)


def _holes(switches: Sequence[PlacedSensor], move: Floats, across_mm: float) -> Iterator[Shape]:
    for switch in switches:
        x, y = (switch.x_mm or 0.0) + float(move[0]), (switch.y_mm or 0.0) + float(move[1])
        yield Circle("holes", x, y, across_mm / 2)
        yield Text("names", x, y, 1.4 if switch.number < 100 else 1.0, str(switch.number), centred=True)


def _bar(x: float, y: float) -> Iterator[Shape]:
    yield PatternLine("scale", np.array([[x, y], [x + SCALE_BAR_MM, y]]), closed=False)
    for at in (x, x + SCALE_BAR_MM):
        yield PatternLine("scale", np.array([[at, y - _TICK_MM], [at, y + _TICK_MM]]), closed=False)
    yield Text("names", x, y + _TICK_MM + 1.0, _TEXT_MM, "50 mm: measure it on paper, and print without scaling")


def _legend(switches: Sequence[PlacedSensor], rows: int, left: float) -> Iterator[Shape]:
    """Yield the list of switches, column by column."""
    for place, switch in enumerate(switches):
        column, row = divmod(place, rows)
        x, y = left + column * _COLUMN_MM, MARGIN_MM + (rows - 1 - row) * _ROW_MM
        yield Text("names", x, y, _TEXT_MM, f"{switch.number}  {switch.name}")


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
        colour = _SVG_COLOURS[layer]
        lines = {"fill": "none", "stroke": colour, "stroke-width": f"{_STROKE_MM}"}
        paint = {"fill": colour} if layer == "names" else lines
        attributes = {"id": layer, "inkscape:groupmode": "layer", "inkscape:label": layer, **paint}
        group = ET.SubElement(root, "g", attributes)
        for shape in shapes:
            if shape.layer == layer:
                match shape:
                    case PatternLine(points=points, closed=closed):
                        places = " ".join(f"{x:.3f},{page.height_mm - y:.3f}" for x, y in points)
                        ET.SubElement(group, "polygon" if closed else "polyline", {"points": places})
                    case Circle(x=x, y=y, radius=radius):
                        place = {"cx": f"{x:.3f}", "cy": f"{page.height_mm - y:.3f}"}
                        ET.SubElement(group, "circle", {**place, "r": f"{radius:g}"})
                    case Text():
                        _add_text(group, shape, page.height_mm)
    ET.indent(root, " ")
    return b'<?xml version="1.0" encoding="utf-8"?>\n' + ET.tostring(root, encoding="unicode").encode() + b"\n"


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
