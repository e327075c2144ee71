"""`hand.json`: the positions of a build's inputs on the hand, for pages that draw it (pages/hand.js).

Positions are in mm, x to the right and y up, on the glove laid flat: a right hand, palm up, or as in a layout. If they
are unknown, switches and taxels are placed in a grid, in the build's order, and `placed` is false. Its bytes are
canonical: fields in the order of the structs below, without spaces, one newline at the end. `build.json` holds its
SHA-256.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import msgspec
from msgspec import Meta, Struct

from .build import read_member
from .errors import BuildError
from .json_document import decode_document
from .manifest import Code, Manifest
from .names import fault, shortened
from .recipe import Count, Name, Value

HAND_NAME = "hand.json"
SCHEMA = 1
MAX_BYTES = 4 << 20
_MOST_POINTS = 1 << 16

Length = Annotated[float, Meta(ge=-20_000.0, le=20_000.0)]
Point = tuple[Length, Length]
Line = Annotated[tuple[Point, ...], Meta(max_length=_MOST_POINTS)]
Lines = Annotated[tuple[Line, ...], Meta(max_length=1024)]


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
