"""Grasp types for the planner: the pads that must touch, and the approximate pose of hand and object.

A taxonomy's types are in a table of data (`data/kamakura14.toml`, `data/cutkosky16.toml`), so that a new taxonomy needs
a new table but no code.
"""

import re
from collections.abc import Iterator
from importlib.resources.abc import Traversable
from typing import Annotated

import msgspec
import numpy as np

from thenar.compiler.elementary import Floats
from thenar.runtime.names import nearest
from thenar.runtime.toml_source import Place, TomlText, read_source
from thenar.runtime.toml_struct import as_table, convert

from ..body.hand import CAPSULES, DIGITS, LIMITS_DEG, Hand, Size
from ..errors import SceneError

Triple = tuple[float, float, float]
Angles = tuple[float, float, float, float]

_SIDES = {"pad": (0.0, 0.0, -1.0), "radial": (0.0, 1.0, 0.0), "ulnar": (0.0, -1.0, 0.0), "tip": (0.7, 0.0, -0.7)}
_PAD = re.compile(r"(\w*)(?:\.(\d+))?(?::(\w+))?", re.ASCII)
# Of any size: the number of spheres of a segment does not depend on it.
_HAND = Hand(Size(1.0, 1.0))


class Prehension(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A grasp type.

    thumb, index, middle, ring, little   nominal joint angles in degrees: abduction, first flexion, second, third
    pads      that must touch: CAPSULE, CAPSULE.N for its Nth sphere of skin, CAPSULE:SIDE for another side than the pad
    at        a point of the object's surface: distal over hand length, radial and dorsal over hand breadth
    away      the direction from there to the object's middle
    axis, up  the object's x and z, all in hand axes
    grip_n    total force of the pads, before any weight
    down      direction of the weight
    loose     allowed distance of the object from `at`: mm
    """

    thumb: Angles
    index: Angles
    middle: Angles
    ring: Angles
    little: Angles
    pads: Annotated[tuple[str, ...], msgspec.Meta(min_length=2)]
    at: Triple
    away: Triple
    axis: Triple
    up: Triple
    grip_n: Annotated[float, msgspec.Meta(gt=0.0, le=200.0)]
    down: Triple = (0.0, -1.0, 0.0)
    loose: Annotated[float, msgspec.Meta(gt=0.0, le=200.0)] = 10.0

    def nominal_deg(self) -> Floats:
        """Return the nominal joint angles (20,), order of DOF."""
        return np.array([*self.thumb, *self.index, *self.middle, *self.ring, *self.little])


class _Table(msgspec.Struct, frozen=True):
    types: dict[str, object]


def load_prehensions(file: Traversable) -> dict[str, Prehension]:
    """Return the grasp types in the `[types.*]` of a table, by name. Raises SceneError with file, line and key."""
    source = read_source(file, SceneError)
    types = as_table(source, ("types",), convert(source, (), source.tables(), _Table).types)
    return {name: _prehension(source, ("types", name), table) for name, table in types.items()}


def pad_sphere(hand: Hand, pad: str) -> int:
    """Return the number of the sphere of skin that `pad` names. Raises ValueError if there is none."""
    capsule, which, _ = _parts(pad)
    spheres = np.flatnonzero(hand.sphere_capsules == CAPSULES.index(capsule))
    if which is None:
        return int(spheres[-1 if capsule.endswith("distal") else len(spheres) // 2])
    if not 1 <= int(which) <= len(spheres):
        raise ValueError(f"{pad!r}: {capsule} has spheres of skin 1 to {len(spheres)}, not {which}")
    return int(spheres[int(which) - 1])


def pad_side(pad: str) -> Floats:
    """Return the direction (3,) of `pad` in its capsule's axes. Raises ValueError if there is none."""
    return np.array(_SIDES[_parts(pad)[2]])


def _parts(pad: str) -> tuple[str, str | None, str]:
    """Return the capsule, the number of the sphere, and the side that `pad` names."""
    found = _PAD.fullmatch(pad)
    if found is None:
        raise ValueError(f"{pad!r} is not a pad: write CAPSULE, CAPSULE.NUMBER, or CAPSULE:SIDE")
    capsule, which, side = found[1], found[2], found[3] or "pad"
    if capsule not in CAPSULES:
        raise ValueError(f"{pad!r}: there is no segment {capsule!r}{nearest(capsule, CAPSULES)}")
    if side not in _SIDES:
        raise ValueError(f"{pad!r}: there is no side {side!r}; there are {', '.join(_SIDES)}")
    return capsule, which, side


def _prehension(source: TomlText, place: Place, table: object) -> Prehension:
    found = convert(source, place, table, Prehension)
    for key, reason in _faults(found):
        raise source.error((*place, *key), reason)
    return found


def _faults(prehension: Prehension) -> Iterator[tuple[Place, str]]:
    """Yield the faults that prevent planning, with their keys."""
    yield from _bad_angles(prehension)
    yield from _bad_pads(prehension.pads)
    for key in ("away", "axis", "up", "down"):
        if not any(getattr(prehension, key)):
            yield (key,), "is a direction: not all of its numbers can be 0"
    axis, up = np.array(prehension.axis), np.array(prehension.up)
    across = np.cross(axis, up)
    if across @ across < 1e-6 * (axis @ axis) * (up @ up):
        yield ("up",), "is parallel to `axis`: the object's z must be across its x"


def _bad_angles(prehension: Prehension) -> Iterator[tuple[Place, str]]:
    limits = dict(zip(DIGITS, LIMITS_DEG.reshape(5, 4, 2).tolist(), strict=True))
    for digit in DIGITS:
        for number, (angle, (low, high)) in enumerate(zip(getattr(prehension, digit), limits[digit], strict=True)):
            if not low <= angle <= high:
                yield (digit, number), f"must be {low:g} to {high:g}, the range of the joint, not {angle:g}"


def _bad_pads(pads: tuple[str, ...]) -> Iterator[tuple[Place, str]]:
    seen: dict[int, str] = {}
    for number, pad in enumerate(pads):
        try:
            pad_side(pad)
            sphere = pad_sphere(_HAND, pad)
        except ValueError as reason:
            yield ("pads", number), str(reason)
            return
        if sphere in seen:
            yield ("pads", number), f"{pad!r} is the same skin as {seen[sphere]!r}"
        seen[sphere] = pad
