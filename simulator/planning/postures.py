"""Planned postures as data: for every grasp type and object, postures at some hand lengths.

Postures are interpolated between two lengths; each length is planned from the next, so neighbours differ little. An
entry is found by its grasp type and the object's shape, so a changed object never gets an old posture.

A file is JSON: {"format": 1, "taxonomy": NAME, "entries": [{grasp, object, shape, grip_n, down, spheres, held:
[{length_mm, posture_deg, pose, shares}, ...]}, ...]}.
"""

from collections.abc import Iterable
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal, Self

import msgspec
import numpy as np

from thenar.runtime.files import read_file, write_atomically

from ..body.condition import Pad, PlannedGrasp, Thing
from ..body.hand import Hand, Size
from ..body.shapes import Shape
from ..contact.model import GRAVITY
from ..errors import SceneError

LARGEST = 10_000_000  # bytes; the shipped files have a two-hundredth of it
_SPHERES = len(Hand(Size(1.0, 1.0)).sphere_capsules)

_Share = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]
_Sphere = Annotated[int, msgspec.Meta(ge=0, lt=_SPHERES)]

# A hand presses an object like a weightless one, plus a force at which pads with this friction on its two sides would
# bear twice its weight.
FRICTION = 0.8


class HeldAt(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A posture at one hand length: joint angles (20) in degrees, pose (6) in mm and radians, shares of the pads."""

    length_mm: float
    posture_deg: Annotated[tuple[float, ...], msgspec.Meta(min_length=20, max_length=20)]
    pose: Annotated[tuple[float, ...], msgspec.Meta(min_length=6, max_length=6)]
    shares: tuple[_Share, ...]


class Entry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The grasp of one object with one grasp type: spheres of skin that press, and a posture per hand length."""

    grasp: str
    object: str
    shape: Shape
    grip_n: Annotated[float, msgspec.Meta(gt=0.0)]
    down: tuple[float, float, float]
    spheres: Annotated[tuple[_Sphere, ...], msgspec.Meta(min_length=1)]
    held: Annotated[tuple[HeldAt, ...], msgspec.Meta(min_length=1)]

    def __post_init__(self) -> None:
        lengths = [held.length_mm for held in self.held]
        if any(low >= high for low, high in pairwise(lengths)):
            raise ValueError(f"the hands of {self.object!r} are not in order, shortest first")
        if any(len(held.shares) != len(self.spheres) for held in self.held):
            raise ValueError(f"{self.object!r} has {len(self.spheres)} spheres, but not a share for each")

    def covers(self, length_mm: float) -> bool:
        """Return whether a hand of this length is between planned ones."""
        return self.held[0].length_mm <= length_mm <= self.held[-1].length_mm


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    format: Literal[1]
    taxonomy: str
    entries: tuple[Entry, ...]


class Postures:
    """The planned postures of a taxonomy's grasp types; of two entries for one type and shape, the later counts."""

    def __init__(self, taxonomy: str, entries: Iterable[Entry]) -> None:
        self.taxonomy = taxonomy
        self._found = {(entry.grasp, entry.shape): entry for entry in entries}
        self.entries = tuple(self._found.values())

    @classmethod
    def shipped(cls, taxonomy: str) -> Self:
        """Return the shipped postures for a taxonomy, which may be none."""
        resource = files(__package__) / "data" / f"{taxonomy}.postures.json"
        return cls.decode(resource.read_bytes()) if resource.is_file() else cls(taxonomy, ())

    @classmethod
    def load(cls, path: Path) -> Self:
        """Return the postures that `save` wrote. Raises OSError or ValueError if the file is missing or invalid."""
        return cls.decode(read_file(path, LARGEST, SceneError))

    @classmethod
    def decode(cls, content: bytes) -> Self:
        """Return the postures in the content of a file. Raises ValueError if it is invalid."""
        try:
            known = msgspec.json.decode(content, type=_File)
        except RecursionError as reason:
            raise ValueError(str(reason)) from None
        return cls(known.taxonomy, known.entries)

    def save(self, path: Path) -> None:
        """Write the file whole or not at all."""
        write_atomically(path, msgspec.json.encode(_File(1, self.taxonomy, self.entries)) + b"\n")

    def entry(self, grasp: str, thing: Thing) -> Entry | None:
        """Return the planned entry of this grasp type and object shape, if any."""
        return self._found.get((grasp, thing.shape))

    def held(self, hand: Hand, grasp: str, thing: Thing) -> PlannedGrasp:
        """Return the grasp of `thing` by `hand`, interpolated between the two planned lengths next to its own.

        Raises SceneError naming grasp and object if nothing was planned, or not for this size of hand.
        """
        entry, length = self.entry(grasp, thing), hand.size.length_mm
        if entry is None or not entry.covers(length):
            raise SceneError(
                f"no planned posture of grasp type {grasp!r} with object {thing.name!r} for a hand of {length:g} mm"
            )
        lengths = [held.length_mm for held in entry.held]
        above = min(max(sum(known < length for known in lengths), 1), len(lengths) - 1)
        low, high = entry.held[max(above - 1, 0)], entry.held[above]
        return _between(entry, low, high, length, entry.grip_n + thing.mass_kg * GRAVITY / FRICTION)


def _between(entry: Entry, low: HeldAt, high: HeldAt, length: float, grip_n: float) -> PlannedGrasp:
    span = high.length_mm - low.length_mm
    part = (length - low.length_mm) / span if span else 0.0
    posture, pose, shares = (
        np.array(a) * (1.0 - part) + np.array(b) * part
        for a, b in ((low.posture_deg, high.posture_deg), (low.pose, _near(low, high)), (low.shares, high.shares))
    )
    pads = tuple(Pad(sphere, float(share)) for sphere, share in zip(entry.spheres, shares, strict=True))
    return PlannedGrasp(posture, pose, pads, grip_n, np.array(entry.down))


def _near(low: HeldAt, high: HeldAt) -> tuple[float, ...]:
    """Return the pose at `high`, with the rotation vector nearest to that at `low`.

    For a rotation of about 180 degrees rounding decides between two opposite vectors, whose mean would be no rotation.
    """
    turn = np.array(high.pose[3:])
    angle = float(np.sqrt(np.add.reduce(turn * turn)))
    if angle == 0.0:
        return high.pose
    other = turn * (1.0 - 2.0 * np.pi / angle)
    here, there = (np.add.reduce((way - low.pose[3:]) ** 2) for way in (turn, other))
    return high.pose if here <= there else (*high.pose[:3], *other.tolist())
