"""Preshapes of a robot hand for grasp types, and when to change them: only after a type has been certain for a moment.

Tables of preshapes are TOML: shipped ones by name, and the user's by path.

name = "My gripper"
time_from_start_s = 1.0

[[joints]]                      # any number, in the order of the positions below
name = "finger_joint"
unit = "deg"                    # deg, rad, mm or m
range = [0, 45]                 # in that unit; positions outside are rejected

[[preshapes]]
name = "open"
positions = [0]                 # one per joint, each in its joint's unit
grasps = ["PoS", "CMF"]         # the grasp types, spelled as in the build; "none": while nothing is held
"""

import math
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import msgspec
from msgspec import Meta

from thenar.drivers.errors import SettingError

from ..names import fault, nearest, shortened
from ..published import NONE, UNKNOWN, LiveGrasp, Preshape
from ..toml_source import Place, read_source
from ..toml_struct import Fault, convert, wrong_names

if TYPE_CHECKING:
    from importlib.resources.abc import Traversable

    from ..build import Build


@dataclass(frozen=True, slots=True)
class PreshapeTable:
    """The preshapes of one robot hand: `chosen` holds one for every grasp type in the table.

    The table may also name "none": the preshape that opens the hand while nothing is held.
    """

    name: str
    chosen: Mapping[str, Preshape]

    def check(self, grasps: Iterable[str]) -> str:
        """Return a sentence about grasp types of the build (`grasps`) that have no preshape, or "" if all have one.

        Raises SettingError if the table names none of them, since it is for another taxonomy.
        """
        wanted = tuple(grasp for grasp in grasps if grasp != NONE)
        missing = tuple(grasp for grasp in wanted if grasp not in self.chosen)
        if not missing:
            return ""
        spare = [grasp for grasp in self.chosen if grasp not in wanted]
        from difflib import get_close_matches  # for messages only

        likely = {grasp: get_close_matches(grasp, spare, n=1, cutoff=0.8) for grasp in missing}
        if len(missing) == len(wanted) and not any(likely.values()):
            raise SettingError(
                f"preshapes {self.name}: none of the build's grasp types ({', '.join(wanted)}) is among the table's "
                f"({', '.join(self.chosen)}): use a table for the taxonomy of the build"
            )
        names = [grasp + "".join(f" (the table has {near!r})" for near in likely[grasp]) for grasp in missing]
        return f"preshapes {self.name}: none for {', '.join(names)}: nothing is sent to the hand for those"


MIN_PROBABILITY = 0.8
SETTLE_MS = 100


class PreshapeSelector:
    """Holds the last confident preshape.

    It changes to another only if every frame of the last `settle_ms` called for that one, each with at least
    `min_probability`. Until then it returns the preshape that it holds. On "unknown", and on a grasp type missing from
    the table, it returns None, and the hand stays where it is. While nothing is held, the last preshape stays, unless
    the table names one for "none".

    With `segments`, the type of the segment calls for a preshape, while it forms and while it is held, if the build
    knows "none". Once the preshape of a held segment is taken, it changes only after nothing was held, unless
    `change_while_held`. Without `segments`, `LiveGrasp.grasp` calls for it.
    """

    def __init__(
        self,
        table: PreshapeTable,
        *,
        min_probability: float = MIN_PROBABILITY,
        settle_ms: float = SETTLE_MS,
        segments: bool = False,
        change_while_held: bool = False,
    ) -> None:
        """Raise SettingError unless 0 <= min_probability <= 1 and settle_ms >= 0."""
        if not 0 <= min_probability <= 1:
            raise SettingError(f"the minimum probability of a preshape must be between 0 and 1, not {min_probability}")
        if not settle_ms >= 0:
            raise SettingError(f"the settle time of a preshape must be 0 ms or more, not {settle_ms}")
        self._table = table
        self._min_probability = min_probability
        self._settle_us = settle_ms * 1000
        self._segments, self._change = segments, change_while_held
        self._held: Preshape | None = None
        self._called: Preshape | None = None
        self._since_us = 0
        self._locked = False

    def update(self, grasp: LiveGrasp) -> Preshape | None:
        """Return the preshape that the hand should have now, or None to send it nothing."""
        type_, probability = grasp.grasp, grasp.probability
        if self._segments:
            type_, probability = grasp.segment_type, 1.0 if grasp.state == "none" else grasp.segment_probability
            self._locked &= grasp.state != "none"
        if type_ == UNKNOWN or grasp.health == "unknown":
            self._called = None
            return None
        wanted = self._table.chosen.get(type_)
        called = wanted if probability >= self._min_probability else None
        if called is not self._called:
            self._called, self._since_us = called, grasp.time_us
        if called is not None and grasp.time_us - self._since_us >= self._settle_us:
            if not self._locked:
                self._held = called
            self._locked |= grasp.state == "held" and called is self._held and self._segments and not self._change
        return None if wanted is None and type_ != NONE else self._held


SHIPPED = ("barrett_bh8", "parallel_gripper")

_TO_SI = {"deg": math.pi / 180, "rad": 1.0, "mm": 0.001, "m": 1.0}

_Name = Annotated[str, Meta(min_length=1)]


class _Joint(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    name: _Name
    unit: Literal["deg", "rad", "mm", "m"]
    range: tuple[float, float]


class _Entry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    name: _Name
    positions: tuple[float, ...]
    grasps: tuple[_Name, ...]


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    name: _Name
    time_from_start_s: Annotated[float, Meta(gt=0, le=60)]
    joints: tuple[_Joint, ...]
    preshapes: tuple[_Entry, ...]


def load_preshapes(name: str | os.PathLike[str]) -> PreshapeTable:
    """Return a table shipped with thenar, by its name (one of SHIPPED), or the user's, by its path.

    Raises SettingError naming the file, its line and the key.
    """
    source = read_source(_find(name), SettingError)
    content = convert(source, (), source.tables(), _File)
    for place, reason in _faults(content):
        raise source.error(place, reason)
    names, factors = tuple(joint.name for joint in content.joints), [_TO_SI[joint.unit] for joint in content.joints]
    chosen = dict[str, Preshape]()
    for entry in content.preshapes:
        positions = tuple(position * factor for position, factor in zip(entry.positions, factors, strict=True))
        preshape = Preshape(entry.name, names, positions, content.time_from_start_s)
        chosen |= dict.fromkeys(entry.grasps, preshape)
    return PreshapeTable(content.name, chosen)


def preshape_selector(
    name: str | os.PathLike[str], build: "Build", *, segments: bool = True, change_while_held: bool = False
) -> tuple[PreshapeSelector, str]:
    """Return a selector for a build, and a sentence on grasp types that have no preshape, or "".

    It selects by `segments` if the build was trained with rows in which nothing is held, otherwise by the grasp type
    alone: a build that only refuses frames misses most losses of contact.

    Raises SettingError.
    """
    table = load_preshapes(name)
    by_segments = segments and build.none is not None
    return PreshapeSelector(table, segments=by_segments, change_while_held=change_while_held), table.check(build.grasps)


def _find(name: str | os.PathLike[str]) -> "Traversable":
    if name in SHIPPED:
        from importlib.resources import files

        return files(__package__) / "tables" / f"{name}.toml"
    path = Path(name)
    if not path.exists():
        raise SettingError(
            f"there is neither a file {path} nor a table of that name{nearest(str(name), SHIPPED)}: "
            "name a shipped table, or the path of your own"
        )
    return path


def _faults(content: _File) -> Iterator[Fault]:
    """Yield the places and reasons of what is wrong beyond the types of fields; the first one counts."""
    if not content.joints:
        yield ("joints",), "must name at least one joint"
    joints, preshapes = (
        [((table, number, "name"), one.name) for number, one in enumerate(getattr(content, table))]
        for table in ("joints", "preshapes")
    )
    yield from wrong_names(joints, "joint")
    yield from wrong_names(preshapes, "preshape")
    for number, joint in enumerate(content.joints):
        if joint.range[0] > joint.range[1]:
            yield ("joints", number, "range"), "must be the lowest and then the highest position"
    for number, entry in enumerate(content.preshapes):
        yield from _of_positions(("preshapes", number, "positions"), entry, content.joints)
    grasps: dict[str, str] = {}
    for number, entry in enumerate(content.preshapes):
        for index, grasp in enumerate(entry.grasps):
            place = ("preshapes", number, "grasps", index)
            if reason := fault(grasp):
                yield place, f"{shortened(repr(grasp))} {reason}"
            if grasp in grasps:
                yield place, f"{grasp!r} already has preshape {grasps[grasp]!r}"
            grasps[grasp] = entry.name
    if not grasps:
        yield ("preshapes",), "must name at least one grasp type"


def _of_positions(place: Place, entry: _Entry, joints: tuple[_Joint, ...]) -> Iterator[Fault]:
    if len(entry.positions) != len(joints):
        yield place, f"must be {len(joints)} positions, one per joint, not {len(entry.positions)}"
    for number, (position, joint) in enumerate(zip(entry.positions, joints, strict=True)):
        low, high = joint.range
        if not low <= position <= high:
            reason = f"{position:g} {joint.unit} is outside {low:g} to {high:g}, the range of {joint.name}"
            yield (*place, number), reason
