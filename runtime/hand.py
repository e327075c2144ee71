"""`hand.json`: the positions of a build's inputs on the hand, for pages that draw it (pages/hand.js).

Positions are in mm, x to the right and y up, on the glove laid flat: a right hand, palm up, or as in a layout. If they
are unknown, switches and taxels are placed in a grid, in the build's order, and `placed` is false. Its bytes are
canonical: fields in the order of the structs below, without spaces, one newline at the end. `build.json` holds its
SHA-256.
"""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated

import msgspec
from msgspec import Meta, Struct

from .build import read_member
from .errors import BuildError
from .json_document import decode_document
from .manifest import Calibration, Code, Manifest
from .names import fault, shortened
from .recipe import Count, Name, Value

HAND_NAME = "hand.json"
SCHEMA = 1
MAX_BYTES = 4 << 20
# Spacing of the grid: it leaves room for a name under each place.
_COLUMNS, _PITCH_MM, GRID_RADIUS_MM = 4, (50.0, 22.0), 3.0
_MOST_POINTS = 1 << 16

Length = Annotated[float, Meta(ge=-20_000.0, le=20_000.0)]
Point = tuple[Length, Length]
Line = Annotated[tuple[Point, ...], Meta(max_length=_MOST_POINTS)]
Lines = Annotated[tuple[Line, ...], Meta(max_length=1024)]

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


class Spot(Struct, frozen=True, forbid_unknown_fields=True):
    """A name and its position."""

    name: Name
    x_mm: Length
    y_mm: Length


class DrawnSwitch(Spot, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A switch of the glove, and its index among the kept ones, from 0 in the build's order; None: it is not kept."""

    bit: Count | None = None


class DrawnTaxel(Spot, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A taxel of the glove, and its kept levels: the code above which each is closed, ascending, and its index among
    the kept switches of the build.
    """

    levels: tuple[tuple[Code, Count], ...] = ()


class DrawnJoint(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A joint of the build, counted from 0 in its order, with the least and the greatest of its values, in its unit.

    digit  "thumb" to "little", "palm" or "wrist"; "" if the name does not say
    moves  "rotation", "abduction", "mcp", "pip", "dip", "ip", "curl" (all of a digit), "arch", "pitch" or "yaw"
    """

    name: Name
    joint: Count
    unit: str
    low: Value
    high: Value
    digit: str = ""
    moves: str = ""


class HandDrawing(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The content of `hand.json`.

    view       a description of the view
    placed     whether the positions are those on the glove
    radius_mm  of the circle drawn for a switch
    outline    points along the edge of the hand; strips: closed lines, creases: open lines; labels: names of digits
    """

    schema: int = SCHEMA
    view: str
    placed: bool
    radius_mm: Annotated[float, Meta(gt=0.0, le=1000.0)]
    outline: Line = ()
    strips: Lines = ()
    creases: Lines = ()
    labels: tuple[Spot, ...] = ()
    switches: tuple[DrawnSwitch, ...]
    taxels: tuple[DrawnTaxel, ...]
    joints: tuple[DrawnJoint, ...]


def load_hand(folder: Path, manifest: Manifest) -> HandDrawing:
    """Return the drawing in the build's folder.

    Raises BuildError, naming the file, if it is missing, damaged, or of another build.
    """
    path = folder / HAND_NAME
    if manifest.hand_sha256 is None:
        raise BuildError(f"{path} is not described by build.json: compile the build again")
    return hand_from_bytes(read_member(path, MAX_BYTES, manifest.hand_sha256), manifest, str(path))


def hand_to_bytes(hand: HandDrawing) -> bytes:
    """Return the content of `hand.json`."""
    return msgspec.json.encode(hand) + b"\n"


def hand_from_bytes(data: bytes, manifest: Manifest, what: str = HAND_NAME) -> HandDrawing:
    """Return the drawing in a `hand.json`, whose name in messages is `what`.

    Raises BuildError if it is oversized, no such document, of another schema, or of another build.
    """
    hand = decode_document(data, HandDrawing, what, "a drawing of a hand", MAX_BYTES, SCHEMA)
    for wrong in _contradictions(hand, manifest):
        raise BuildError(f"{what} {wrong}: compile the build again")
    return hand


def _contradictions(hand: HandDrawing, manifest: Manifest) -> Iterator[str]:
    """Yield the contradictions between the drawing and the build."""
    spots: tuple[Spot, ...] = (*hand.labels, *hand.switches, *hand.taxels)
    for name in (*(spot.name for spot in spots), *(joint.name for joint in hand.joints)):
        if reason := fault(name):
            yield f"has {shortened(repr(name))}, a name which {reason}"
    kept: list[tuple[int, str, int | None]] = [
        (each.bit, each.name, None) for each in hand.switches if each.bit is not None
    ]
    kept += [(bit, each.name, code) for each in hand.taxels for code, bit in each.levels]
    own = [
        (bit, switch.source, switch.threshold and switch.threshold.code) for bit, switch in enumerate(manifest.switches)
    ]
    if sorted(kept, key=lambda each: each[0]) != own:
        yield "draws other switches than the build has"
    if any(list(each.levels) != sorted(each.levels) for each in hand.taxels):
        yield "has levels of a taxel that do not rise"
    if [(each.joint, each.name) for each in hand.joints] != [
        (number, joint.name) for number, joint in enumerate(manifest.joints)
    ]:
        yield "draws other joints than the build has"


def grid_hand(manifest: Manifest, ranges: Sequence[tuple[int, int]] | None = None) -> HandDrawing:
    """Return the kept switches and taxels of a build in a grid, and its joints: `ranges` of their codes, if known."""
    names = list(dict.fromkeys(switch.source for switch in manifest.switches))
    places = grid_places(names)
    taxels = tuple(switch.source for switch in manifest.switches if switch.threshold is not None)
    return HandDrawing(
        view="switches and taxels in the order of the build; their positions on the hand are unknown" if names else "",
        placed=False,
        radius_mm=GRID_RADIUS_MM,
        switches=drawn_switches(manifest, {name: at for name, at in places.items() if name not in taxels}),
        taxels=drawn_taxels(manifest, {name: places[name] for name in dict.fromkeys(taxels)}),
        joints=drawn_joints(manifest.joints, ranges),
    )


def grid_places(names: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return a place in a grid for each name, for inputs whose positions are unknown."""
    wide, high = _PITCH_MM
    return {name: (wide * (at % _COLUMNS), -high * (at // _COLUMNS)) for at, name in enumerate(names)}


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
        low, high = sorted(round(_value(joint, code), 3) for code in codes)
        found.append(DrawnJoint(joint.name, number, joint.unit, low, high, *moved_by(joint.name)))
    return tuple(found)


def _value(joint: Calibration, code: int) -> float:
    step = (joint.value_b - joint.value_a) / (joint.code_b - joint.code_a)
    return joint.value_a + (code - joint.code_a) * step


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
