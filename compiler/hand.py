"""A hand laid flat, with its switches, for pictures, reports, specs and `hand.json`.

The positions come from a hand map (simulator/handmaps) or from a user's layout, a TOML file of a home-made glove, so
nothing here depends on how hands are simulated.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import Meta, Struct
from numpy.typing import NDArray

from thenar.drivers.errors import ThenarError
from thenar.runtime.hand import (
    DrawnJoint,
    DrawnSwitch,
    DrawnTaxel,
    HandDrawing,
    Line,
    Spot,
)
from thenar.runtime.manifest import Calibration, Manifest
from thenar.runtime.names import fault, nearest, shortened
from thenar.runtime.toml_source import read_source
from thenar.runtime.toml_struct import convert

Floats = NDArray[np.float64]
_LARGEST_DOT_MM, _SMALLEST_DOT_MM = 4.0, 0.5
# Spacing of the grid: it leaves room for a name under each place.
_COLUMNS, _PITCH_MM, _GRID_RADIUS_MM = 4, (50.0, 22.0), 3.0
_DIGITS = {name: name for name in ("thumb", "index", "middle", "ring", "little")}
_DIGITS |= {"pinky": "little", "pinkie": "little"}
_OUTWARD = ("middle", "index", "ring", "thumb", "little")
# Words in a joint's name, and the movement each means; the first match counts.
_MOVES = {
    **dict.fromkeys(("abduction", "adduction", "abd", "spread"), "abduction"),
    **dict.fromkeys(("rotation", "roll", "opposition", "cmc", "tmj", "tm"), "rotation"),
    **dict.fromkeys(("mpj", "mcp", "mp"), "mcp"),
    **dict.fromkeys(("pij", "pip"), "pip"),
    **dict.fromkeys(("dij", "dip"), "dip"),
    **dict.fromkeys(("ij", "ip"), "ip"),
    **dict.fromkeys(("flexion", "flex", "bend", "curl"), "curl"),
}
_WRIST = dict.fromkeys(("pitch", "flexion", "extension"), "pitch") | dict.fromkeys(("yaw", "deviation"), "yaw")
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")
_WHOLE = "glove"  # the part of switches that are on no part
Length = Annotated[float, Meta(ge=-10_000.0, le=10_000.0)]
Place = tuple[Length, Length]
_NEAREST_MM = 0.5  # points closer than this to the last one drawn are omitted


class MapError(ThenarError, ValueError):
    """A switch or a set that cannot be drawn on the hand."""


@dataclass(frozen=True, slots=True, eq=False)
class HandShape:
    """A glove laid flat; all positions in mm for a hand of `length_mm`.

    The shipped one is a right hand, palm up, thumb right, with the digits' sides unfolded. A user's layout is drawn to
    scale and has no length (None); its outline, strips, creases and labels may be empty.

    names, places (s, 2)  the switches and their centres; radius_mm of the circle that represents one
    parts (s,)            index of each switch's part in part_names: the digits from the thumb on, then the palm
    sides (s,)            -1 on the unfolded left side of its digit, 1 on the right one, 0 elsewhere
    outline (k, 2)        the hand from cuff to cuff; creases: open lines
    strips                outlines of the unfolded sides, left and right of the thumb, then of the index, ...
    labels (digits, 2)    where a digit's name is written, above its tip
    part_number           of a switch to buy, and body_mm, its width; "" and 0 if open
    """

    glove: str
    length_mm: float | None
    names: tuple[str, ...]
    places: Floats
    radius_mm: float
    part_names: tuple[str, ...]
    parts: NDArray[np.intp]
    sides: NDArray[np.intp]
    outline: Floats
    strips: tuple[Floats, ...]
    creases: tuple[Floats, ...]
    labels: Floats
    part_number: str = ""
    body_mm: float = 0.0

    @property
    def view(self) -> str:
        """Description of the view."""
        if self.length_mm is None:
            return f"the glove as drawn in {self.glove}"
        return "a right hand, palm up, thumb right, the sides of its digits unfolded"

    @property
    def wrist(self) -> tuple[float, float]:
        """Where the wires end: in the middle of the glove's cuff; for a user's layout, in the middle below it."""
        if self.length_mm is not None:
            x, y = (self.outline[0] + self.outline[-1]) / 2
            return float(x), float(y)
        points = np.concatenate([self.outline, self.places])
        (left, bottom), (right, _) = points.min(axis=0), points.max(axis=0)
        return float((left + right) / 2), float(bottom)

    def fitted(self, names: Sequence[str], length_mm: float | None = None) -> "HandShape | None":
        """Return the hand at that length if it has all the switches `names`; None if not, or without names."""
        if not names or not self.knows(names):
            return None
        return self if length_mm is None else self.scaled(length_mm)

    def scaled(self, length_mm: float) -> "HandShape":
        """Return the same hand at another length, with its proportions; the size of a switch stays."""
        if self.length_mm is None:
            raise MapError(f"{self.glove} is drawn to scale: only the glove that thenar draws can be resized")
        factor = length_mm / self.length_mm
        return replace(
            self,
            length_mm=length_mm,
            places=self.places * factor,
            outline=self.outline * factor,
            strips=tuple(strip * factor for strip in self.strips),
            creases=tuple(crease * factor for crease in self.creases),
            labels=self.labels * factor,
        )

    @property
    def by_name(self) -> dict[str, tuple[float, float]]:
        """Position of each switch, mm, by its name."""
        return {name: (x, y) for name, (x, y) in zip(self.names, self.places.tolist(), strict=True)}

    def knows(self, names: Sequence[str]) -> bool:
        """Return whether every one of `names` is a switch or taxel of this hand, or a level of one ("pad3>118")."""
        return set(map(self._place_of, names)) <= set(self.names)

    def _place_of(self, name: str) -> str:
        return name if name in self.names else name.rpartition(">")[0]

    def numbers_of(self, names: Sequence[str]) -> NDArray[np.intp]:
        """Return the numbers of the switches called `names`; for a level, its taxel's. Raises MapError that names the
        first unknown one.
        """
        number = {name: number for number, name in enumerate(self.names)}
        places = list(map(self._place_of, names))
        strange = next((name for name, place in zip(names, places, strict=True) if place not in number), None)
        if strange is not None:
            if self.length_mm is not None and number.keys().isdisjoint(places):
                raise MapError(f"the position of switch {strange!r} is unknown: say it with ``layout``")
            raise MapError(f"{strange!r} is no switch of the glove {self.glove}{nearest(strange, self.names)}")
        return np.array([number[place] for place in places], dtype=np.intp)


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
    source = read_source(path, MapError)
    layout = convert(source, (), source.tables(), Places)
    part_of: dict[str, str] = {}
    for part, switches in layout.parts.items():
        for name in switches:
            if name not in layout.places:
                raise source.error(("parts", part), f"{shortened(repr(name))} is not among the places")
            if name in part_of:
                raise source.error(("parts", part), f"{name!r} is on {part_of[name]!r} already: a switch has one part")
            part_of[name] = part
    for name in (*layout.places, *layout.parts, *filter(None, [layout.part_number])):
        if reason := fault(name):
            raise MapError(f"{path.name}: {shortened(repr(name))} {reason}")
    if not layout.places:
        raise MapError(f"{path.name} has no switch: give places to the names of the columns")
    names, places = tuple(layout.places), np.array(list(layout.places.values()), np.float64)
    parts = [part_of.get(name, _WHOLE) for name in names]
    part_names = tuple(dict.fromkeys((*layout.parts, *parts)))
    gaps = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
    np.fill_diagonal(gaps, np.inf)
    # At which no two switches overlap.
    most_mm = min(layout.body_mm / 2 or _LARGEST_DOT_MM, 0.45 * float(gaps.min(initial=np.inf)))
    return HandShape(
        glove=path.name,
        length_mm=None,
        names=names,
        places=places,
        radius_mm=max(_SMALLEST_DOT_MM, most_mm),
        part_names=part_names,
        parts=np.array([part_names.index(part) for part in parts], np.intp),
        sides=np.zeros(len(names), np.intp),
        outline=np.array(layout.outline, np.float64).reshape(-1, 2),
        strips=(),
        creases=(),
        labels=np.empty((0, 2)),
        part_number=layout.part_number,
        body_mm=layout.body_mm,
    )


def drawn_hand(
    manifest: Manifest,
    hand: HandShape | None,
    switch_names: Sequence[str],
    taxel_names: Sequence[str],
    codes: NDArray[np.uint16],
) -> HandDrawing:
    """Return the drawing of a build on `hand`, with all recorded switches and taxels and the kept ones marked.

    `codes` (n, j) are the codes of the build's joints in the training rows. Without a hand that has positions for the
    switches, the kept ones are drawn in a grid.
    """
    ranges = None if not len(codes) else list(zip(codes.min(axis=0).tolist(), codes.max(axis=0).tolist(), strict=True))
    if not manifest.switches or hand is None or not hand.knows([*switch_names, *taxel_names]):
        return grid_hand(manifest, ranges)
    return HandDrawing(
        **shape_of(hand),
        switches=drawn_switches(manifest, places_of(hand, switch_names)),
        taxels=drawn_taxels(manifest, places_of(hand, taxel_names)),
        joints=drawn_joints(manifest.joints, ranges),
    )


def shape_of(hand: HandShape) -> dict[str, Any]:
    """Return the fields of a drawing that show the hand."""
    return {
        "view": hand.view,
        "placed": True,
        "radius_mm": round(hand.radius_mm, 2),
        "outline": _thinned(hand.outline),
        "strips": tuple(map(_thinned, hand.strips)),
        "creases": tuple(map(_thinned, hand.creases)),
        "labels": tuple(Spot(name, x, y) for name, (x, y) in zip(hand.part_names, _rounded(hand.labels), strict=False)),
    }


def places_of(hand: HandShape, names: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return the positions of switches and taxels by name, in mm. Raises MapError for an unknown one."""
    return dict(zip(names, _rounded(hand.places[hand.numbers_of(names)]), strict=True))


def _thinned(points: Floats) -> Line:
    if not len(points):
        return ()
    drawn = [points[0]]
    for point in points[1:-1]:
        if np.hypot(*(point - drawn[-1])) >= _NEAREST_MM:
            drawn.append(point)
    return tuple(_rounded(np.array([*drawn, points[-1]])))


def _rounded(points: Floats) -> list[tuple[float, float]]:
    # Adding 0 turns a rounded -0 into 0.
    return [(x, y) for x, y in (np.round(points, 1) + 0.0).tolist()]


def unknown_shape(view: str) -> dict[str, Any]:
    """Return the fields of a drawing whose positions are unknown, for `grid_places`; `view` describes it."""
    return {"view": view, "placed": False, "radius_mm": _GRID_RADIUS_MM}


def grid_places(names: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return places in a grid for switches and taxels whose positions are unknown, by name, in mm."""
    wide, high = _PITCH_MM
    return {name: (wide * (at % _COLUMNS), -high * (at // _COLUMNS)) for at, name in enumerate(names)}


def grid_hand(manifest: Manifest, ranges: Sequence[tuple[int, int]] | None = None) -> HandDrawing:
    """Return the kept switches and taxels of a build in a grid, and its joints: `ranges` of their codes, if known."""
    names = list(dict.fromkeys(switch.source for switch in manifest.switches))
    places = grid_places(names)
    taxels = tuple(switch.source for switch in manifest.switches if switch.threshold is not None)
    return HandDrawing(
        **unknown_shape(
            "switches and taxels in the order of the build; their positions on the hand are unknown" if names else ""
        ),
        switches=drawn_switches(manifest, {name: at for name, at in places.items() if name not in taxels}),
        taxels=drawn_taxels(manifest, {name: places[name] for name in dict.fromkeys(taxels)}),
        joints=drawn_joints(manifest.joints, ranges),
    )


def drawn_switches(manifest: Manifest, places: dict[str, tuple[float, float]]) -> tuple[DrawnSwitch, ...]:
    """Return switches at their positions, by name, and which of them the build keeps."""
    bits = {switch.name: bit for bit, switch in enumerate(manifest.switches) if switch.threshold is None}
    return tuple(DrawnSwitch(name, x, y, bits.get(name)) for name, (x, y) in places.items())


def drawn_taxels(manifest: Manifest, places: dict[str, tuple[float, float]]) -> tuple[DrawnTaxel, ...]:
    """Return taxels at their positions, by name, with the levels that the build keeps."""
    levels: dict[str, list[tuple[int, int]]] = {name: [] for name in places}
    for bit, switch in enumerate(manifest.switches):
        if switch.threshold is not None:
            levels[switch.source].append((switch.threshold.code, bit))
    return tuple(DrawnTaxel(name, x, y, tuple(sorted(levels[name]))) for name, (x, y) in places.items())


def drawn_joints(
    joints: Sequence[Calibration], ranges: Sequence[tuple[int, int]] | None = None
) -> tuple[DrawnJoint, ...]:
    """Return joints with the movements that their names mean, from the lowest to the highest observed value: `ranges`
    of codes; without them, the codes of the two points of their calibration.
    """
    found = []
    for number, joint in enumerate(joints):
        codes = (joint.code_a, joint.code_b) if ranges is None else ranges[number]
        low, high = sorted(round(joint.value(code), 3) for code in codes)
        found.append(DrawnJoint(joint.name, number, joint.unit, low, high, *moved_by(joint.name)))
    return tuple(found)


def moved_by(name: str) -> tuple[str, str]:
    """Return the digit of a joint of this name, and its movement; ("", "") if the name does not say.

    An abduction between two digits moves the one that is further from the middle finger.
    """
    words = [word.lower() for word in _WORD.findall(name)]
    if "wrist" in words:
        return next((("wrist", _WRIST[word]) for word in words if word in _WRIST), ("", ""))
    if "arch" in words:
        return "palm", "arch"
    digits = [_DIGITS[word] for word in words if word in _DIGITS]
    if not digits:
        return "", ""
    digit = max(digits, key=_OUTWARD.index)
    moves = next((kind for word, kind in _MOVES.items() if word in words), "curl" if len(words) == 1 else "")
    if moves == "ip" and digit != "thumb":
        moves = "pip"
    return (digit, moves) if moves else ("", "")
