"""A user's layout: positions of the switches of a home-made glove, from a TOML file."""

from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta, Struct

from thenar.runtime.names import fault, shortened
from thenar.runtime.toml_source import read_source
from thenar.runtime.toml_struct import check_finite, convert

from .hand import HandShape, MapError

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
    """Return the hand in a .toml file. Raises MapError, with the line."""
    if path.suffix.lower() != ".toml":
        raise MapError(f"{path.name}: a layout is a .toml file")
    layout = _read(path)
    for name in (*layout.places, *layout.parts, *filter(None, [layout.part_number])):
        if reason := fault(name):
            raise MapError(f"{path.name}: {shortened(repr(name))} {reason}")
    if not layout.places:
        raise MapError(f"{path.name} has no switch: give places to the names of the columns")
    return _hand(layout, path.name)


def _read(path: Path) -> Places:
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
