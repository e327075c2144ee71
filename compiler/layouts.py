"""A user's layout: positions of the switches of a home-made glove, from a TOML file or a drawing.

The drawing is an SVG file, such as Inkscape writes: every named shape is a switch, the one called "outline" is the edge
of the glove. Names are Inkscape's labels, or else ids that Inkscape did not generate (circle12). Units, viewBox and
transforms are applied; only names and numbers of the file reach thenar's output.
"""

import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import msgspec
import numpy as np
from msgspec import Meta, Struct

from thenar.runtime.files import read_file
from thenar.runtime.names import fault, shortened
from thenar.runtime.toml_source import read_source
from thenar.runtime.toml_struct import check_finite, convert

from .hand import HandShape, MapError

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

ENDINGS = (".svg", ".toml")
OUTLINE = "outline"
_LARGEST, _MOST = 8 << 20, 4096  # bytes of a drawing, shapes in it
_MM_A_PIXEL = 25.4 / 96
_SHAPES = ("circle", "ellipse", "path", "rect", "polygon", "polyline")
_OF_INKSCAPE = re.compile(r"(?:circle|ellipse|path|rect|polygon|polyline|use|g)[\d-]*")
_LABEL = "{http://www.inkscape.org/namespaces/inkscape}label"
_MODE = "{http://www.inkscape.org/namespaces/inkscape}groupmode"
_NAME, _PART = "data-name", "data-part"
_GEOMETRY = frozenset(("transform", "d", "points", "cx", "cy", "r", "rx", "ry", "x", "y", "width", "height"))
_ABSOLUTE = re.compile(r"[ ]*[0-9.]+(?:[eE][+-]?[0-9]+)?[ ]*(?:mm|cm|in|pt|pc|px)?[ ]*")
_DEEPEST = 64  # groups within groups
_STEPS = 24  # of a curve of the outline
_LARGEST_DOT_MM, _SMALLEST_DOT_MM = 4.0, 0.5
_WHOLE = "glove"

Length = Annotated[float, Meta(ge=-10_000.0, le=10_000.0)]
Place = tuple[Length, Length]


class Places(Struct, frozen=True, forbid_unknown_fields=True):
    """The content of `layout.toml`, in mm: x to the right, y up.

    places       the middle of each switch, by the name of its column
    parts        the parts of the glove, such as fingers, and the switches on each; the others are on "glove"
    outline      points on the edge of the glove
    part_number  of a switch to buy, and body_mm, its width; "" and 0 if open
    """

    places: dict[str, Place]
    parts: dict[str, tuple[str, ...]] = {}
    outline: tuple[Place, ...] = ()
    part_number: str = ""
    body_mm: Annotated[float, Meta(ge=0.0, le=100.0)] = 0.0


def load_layout(path: Path) -> HandShape:
    """Return the hand in an .svg or .toml file. Raises MapError, with the line of a TOML file."""
    kind = path.suffix.lower()
    if kind not in ENDINGS:
        raise MapError(f"{path.name}: a layout is an .svg or a .toml file")
    layout = _of_toml(path) if kind == ".toml" else _of_svg(path)
    for name in (*layout.places, *layout.parts, *filter(None, [layout.part_number])):
        if reason := fault(name):
            raise MapError(f"{path.name}: {shortened(repr(name))} {reason}")
    if not layout.places:
        raise MapError(f"{path.name} has no switch: give the shapes of the drawing the names of the columns")
    return _hand(layout, path.name)


def _of_toml(path: Path) -> Places:
    source = read_source(path, MapError)
    tables = source.tables()
    check_finite(source, (), tables)
    layout = convert(source, (), tables, Places)
    seen: dict[str, str] = {}
    for part, names in layout.parts.items():
        for name in names:
            if name not in layout.places:
                raise source.error(("parts", part), f"{shortened(repr(name))} is not among the places")
            if name in seen:
                raise source.error(("parts", part), f"{name!r} is on {seen[name]!r} already: a switch has one part")
            seen[name] = part
    return layout


def _hand(layout: Places, name: str) -> HandShape:
    names, places = tuple(layout.places), np.array(list(layout.places.values()), np.float64)
    part_of = {switch: part for part, switches in layout.parts.items() for switch in switches}
    found = [part_of.get(each, _WHOLE) for each in names]
    part_names = tuple(dict.fromkeys((*layout.parts, *found)))
    return HandShape(
        glove=name,
        length_mm=None,
        names=names,
        places=places,
        radius_mm=_radius_mm(places, layout.body_mm),
        part_names=part_names,
        parts=np.array([part_names.index(part) for part in found], np.intp),
        sides=np.zeros(len(names), np.intp),
        outline=np.array(layout.outline, np.float64).reshape(-1, 2),
        digits=(),
        strips=(),
        creases=(),
        labels=np.empty((0, 2)),
        part_number=layout.part_number,
        body_mm=layout.body_mm,
    )


def _radius_mm(places: np.ndarray, body_mm: float) -> float:
    """Return the radius at which no two switches overlap, at most half of body_mm if that is given."""
    gaps = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
    np.fill_diagonal(gaps, np.inf)
    most = min(body_mm / 2 or _LARGEST_DOT_MM, 0.45 * float(gaps.min(initial=np.inf)))
    return max(_SMALLEST_DOT_MM, most)


def _of_svg(path: Path) -> Places:
    from svgelements import SVG, Shape

    places, parts, outline = dict[str, Place](), dict[str, tuple[str, ...]](), tuple[Place, ...]()
    plain = _plain(path)
    try:
        drawing = SVG.parse(io.BytesIO(plain))
        height, shapes = float(drawing.height), [shape for shape in drawing.elements() if isinstance(shape, Shape)]
        boxes = [(shape, box) for shape in shapes if (box := shape.bbox()) is not None]
        for shape, (left, top, right, bottom) in boxes:
            name, part = shape.values[_NAME], shape.values.get(_PART)
            if name in places or (name == OUTLINE and outline):
                raise MapError(f"{path.name}: two shapes are called {shortened(repr(name))}")
            if name == OUTLINE:
                outline = tuple(_mm(at.x, at.y, height) for at in _along(shape))
                continue
            places[name] = _mm((left + right) / 2, (top + bottom) / 2, height)
            if part:
                parts[part] = (*parts.get(part, ()), name)
        return msgspec.convert({"places": places, "parts": parts, "outline": outline}, Places)
    except MapError:
        raise
    except (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError) as reason:
        raise MapError(f"{path.name} cannot be read as a drawing in mm: {shortened(str(reason))}") from None


def _along(outline: Any) -> Iterator[Any]:
    """Yield points along a shape."""
    from svgelements import Close, Line, Move
    from svgelements import Path as Pieces

    for piece in Pieces(outline):
        if isinstance(piece, Line | Close) and piece.end is not None:
            yield piece.end
        elif not isinstance(piece, Move | Close):
            yield from (piece.point((step + 1) / _STEPS) for step in range(_STEPS))


def _mm(x: float, y: float, height: float) -> Place:
    return round(float(x) * _MM_A_PIXEL, 3), round((height - float(y)) * _MM_A_PIXEL, 3)


def _plain(path: Path) -> bytes:
    """Return the drawing reduced to its named shapes and their groups: no text, style, use or script."""
    from xml.etree.ElementTree import ParseError, tostring

    from defusedxml.common import DefusedXmlException
    from defusedxml.ElementTree import fromstring

    try:
        root = fromstring(read_file(path, _LARGEST, MapError))
    except DefusedXmlException:
        raise MapError(f"{path.name} declares XML entities: save it as plain SVG") from None
    except (ParseError, LookupError, ValueError) as reason:
        raise MapError(f"{path.name} is no SVG: {shortened(str(reason))}") from None
    if _kind(root) != "svg":
        raise MapError(f"{path.name} is no SVG: it begins with <{shortened(_kind(root))}>")
    if not _ABSOLUTE.fullmatch(root.get("width", "")) or not _ABSOLUTE.fullmatch(root.get("height", "")):
        raise MapError(f"{path.name} does not give its size: set a width and a height of the page in mm")
    if _prune(root, "", 0) > _MOST:
        raise MapError(f"{path.name} has more than {_MOST} named shapes, too many for a glove: unname the others")
    return tostring(root)


def _prune(group: "Element", part: str, depth: int) -> int:
    """Keep only named shapes and groups in `group`, each shape with its name and part; return the number of shapes."""
    count = 0
    for child in list(group):
        kind, label = _kind(child), child.attrib.pop(_LABEL, "")
        name = label or ("" if _OF_INKSCAPE.fullmatch(child.get("id", "")) else child.get("id", ""))
        if kind == "g" and depth < _DEEPEST:
            count += _prune(child, label if child.get(_MODE) == "layer" else part, depth + 1)
        elif kind in _SHAPES and name:
            kept = {key: value for key, value in child.attrib.items() if key in _GEOMETRY}
            child.attrib.clear()
            child.attrib.update(kept | {_NAME: name.strip(), _PART: part.strip()})
            del child[:]
            count += 1
        else:
            group.remove(child)
    return count


def _kind(element: "Element") -> str:
    return str(element.tag).rpartition("}")[2]
