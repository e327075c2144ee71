"""A pattern as DXF of AutoCAD 2000, units of millimetres: what cutters and CAD programs read."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from .pattern import LAYERS, Circle, Line, Pattern, Shape, Text

if TYPE_CHECKING:
    from ezdxf.layouts.layout import Modelspace

# AutoCAD's colour numbers: black or white, blue, grey, red.
_COLOURS = {"outline": 7, "strips": 5, "creases": 8, "holes": 1, "names": 8, "scale": 7}


def dxf_of(pattern: Pattern) -> bytes:
    """Return the drawing, every shape on the layer that it names; the same pattern gives the same bytes."""
    from ezdxf.filemanagement import new
    from ezdxf.units import MM

    text = io.StringIO()
    with _undated():
        document = new("R2000", units=MM)
        for layer in LAYERS:
            document.layers.add(layer, color=_COLOURS[layer])
        space = document.modelspace()
        for shape in pattern.shapes:
            _add(space, shape)
        document.write(text)
    return text.getvalue().encode(document.output_encoding, "dxfreplace")


def _add(space: "Modelspace", shape: Shape) -> None:
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
