"""The cutting pattern: the flat hand with its kept switches on a page, in millimetres at 1:1.

Page coordinates: x to the right, y up, from the lower left corner. The page is the smallest sheet that holds it.
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ..hand import HandShape
from .layout import PlacedSensor, hole_mm

# The margin that most printers leave white.
MARGIN_MM = 5.0
_A4_MM = (210.0, 297.0)
_SHEETS = (("A4", *_A4_MM), ("A3", 297.0, 420.0), ("A2", 420.0, 594.0), ("A1", 594.0, 841.0), ("A0", 841.0, 1189.0))
SCALE_BAR_MM = 50.0
_TITLE_MM, _TEXT_MM, _ROW_MM, _COLUMN_MM = 3.5, 2.0, 3.2, 48.0
_BAR_ROOM_MM, _GAP_MM = 14.0, 4.0
_TICK_MM = 2.0
_SVG_NAMESPACE = "http://www.w3.org/2000/svg"
_INKSCAPE = "http://www.inkscape.org/namespaces/inkscape"
# The layers, and their colours.
LAYERS = {
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


# The page, and the SVG.
Pattern = tuple[Page, bytes]


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
    drawing = _Drawing(page)
    drawing.text(MARGIN_MM, page.height_mm - MARGIN_MM - _TITLE_MM, _TITLE_MM, title)
    if len(hand.outline):
        drawing.line("outline", hand.outline + move, closed=True)
    for strip in hand.strips:
        drawing.line("strips", strip + move, closed=True)
    for crease in hand.creases:
        drawing.line("creases", crease + move)
    for name, (x, y) in zip(hand.part_names, hand.labels + move, strict=False):
        drawing.text(x, y, _TEXT_MM, name, centred=True)
    for switch in switches:
        x, y = (switch.x_mm or 0.0) + float(move[0]), (switch.y_mm or 0.0) + float(move[1])
        drawing.hole(x, y, hole_mm(hand) / 2)
        drawing.text(x, y, 1.4 if switch.number < 100 else 1.0, str(switch.number), centred=True)
    bar = MARGIN_MM + rows * _ROW_MM + _GAP_MM
    right = left + SCALE_BAR_MM
    drawing.line("scale", ((left, bar), (right, bar)))
    for x in (left, right):
        drawing.line("scale", ((x, bar - _TICK_MM), (x, bar + _TICK_MM)))
    drawing.text(left, bar + _TICK_MM + 1.0, _TEXT_MM, "50 mm: measure it on paper, and print without scaling")
    for place, switch in enumerate(switches):
        column, row = divmod(place, rows)
        x, y = left + column * _COLUMN_MM, MARGIN_MM + (rows - 1 - row) * _ROW_MM
        drawing.text(x, y, _TEXT_MM, f"{switch.number}  {switch.name}")
    return page, drawing.svg()


class _Drawing:
    """An SVG of a page: one user unit is one millimetre, and drawing programs show each group as a layer."""

    def __init__(self, page: Page) -> None:
        self._height_mm = page.height_mm
        self._root = ET.Element(
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
        self._layers = dict[str, ET.Element]()
        for layer, colour in LAYERS.items():
            lines = {"fill": "none", "stroke": colour, "stroke-width": f"{_STROKE_MM}"}
            paint = {"fill": colour} if layer == "names" else lines
            attributes = {"id": layer, "inkscape:groupmode": "layer", "inkscape:label": layer, **paint}
            self._layers[layer] = ET.SubElement(self._root, "g", attributes)

    def line(self, layer: str, points: Iterable[Sequence[float]], *, closed: bool = False) -> None:
        """Add a line through points (x, y), back to the first one if `closed`."""
        places = " ".join(f"{x:.3f},{self._height_mm - y:.3f}" for x, y in points)
        ET.SubElement(self._layers[layer], "polygon" if closed else "polyline", {"points": places})

    def hole(self, x: float, y: float, radius: float) -> None:
        """Add a circle."""
        place = {"cx": f"{x:.3f}", "cy": f"{self._height_mm - y:.3f}"}
        ET.SubElement(self._layers["holes"], "circle", {**place, "r": f"{radius:g}"})

    def text(self, x: float, y: float, height: float, words: str, *, centred: bool = False) -> None:
        """Add a line of text with capitals `height` mm high: (x, y) is its start, or its middle if `centred`."""
        baseline = y - height / 2 if centred else y
        attributes = {
            "x": f"{x:.3f}",
            "y": f"{self._height_mm - baseline:.3f}",
            "font-size": f"{height / _CAPITALS:.3f}",
        }
        if centred:
            attributes["text-anchor"] = "middle"
        ET.SubElement(self._layers["names"], "text", attributes).text = words

    def svg(self) -> bytes:
        """Return the bytes of the SVG."""
        ET.indent(self._root, " ")
        content = ET.tostring(self._root, encoding="unicode").encode()
        return b'<?xml version="1.0" encoding="utf-8"?>\n' + content + b"\n"
