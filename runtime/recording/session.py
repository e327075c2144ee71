"""A recording's description of itself: the glove, how it was read, for whom. Stored as text for every MCAP tool.

MCAP holds it as one Metadata record called `thenar`, with the version of this form and the session as JSON. A recording
that was resumed holds one for every time that it was begun, each with its own clock.
"""

from typing import Annotated, Literal

import msgspec

from thenar.drivers.calibration import GloveCalibration

from ..errors import FormatError
from ..names import fault, shortened
from ..policy import Policy
from ..taxels import TaxelCalibration

METADATA = "thenar"
VERSION = "2"
# Limits of any glove, taxonomy and patience. A file that exceeds them is damaged, or made to fill the memory.
_MOST_SWITCHES, _MOST_SENSORS, _MOST_TYPES, _MOST_OBJECTS = 65_536, 255, 10_000, 1000
MOST_TRIALS = 1_000_000

Number = Annotated[int, msgspec.Meta(ge=-(2**63), le=2**63 - 1)]


class CollectionTask(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A grasp type to collect, and its objects, by turns; for "none", the movements of the empty hand."""

    grasp: str
    objects: Annotated[tuple[str, ...], msgspec.Meta(min_length=1, max_length=_MOST_OBJECTS)]


class Collection(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """The plan of a collection: `repetitions` of every task in an order drawn from `seed`.

    `types` are those of the taxonomy, all of them and in its order; `tasks` may be fewer.
    `build` is the checksum of the build that the trials are to adapt, whose codes their set gets; empty: they are for
    none.
    """

    subject: str
    taxonomy: str
    types: Annotated[tuple[str, ...], msgspec.Meta(max_length=_MOST_TYPES)]
    tasks: Annotated[tuple[CollectionTask, ...], msgspec.Meta(max_length=_MOST_TYPES)]
    repetitions: Annotated[int, msgspec.Meta(ge=1, le=MOST_TRIALS)]
    seed: Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]
    build: str = ""


Event = Literal["begun", "captured", "accepted", "redone", "skipped", "undone"]


class Label(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """An event of a trial, numbered from 1 in the order of the collection.

    "begun": the hand moves from now on, to the grasp, or for none until "captured"; "captured": the frames before this
    one are the grasp; "accepted": those captured last are kept; "redone": they are not; "skipped": neither are they,
    and the trial is left for another session; "undone": the kept or skipped result of this trial is revoked, also if it
    is from an earlier session. time_us is the host's monotonic clock.
    """

    time_us: Number
    event: Event
    trial: Number
    grasp: str
    subject: str
    object: str


class Session(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One stretch of recording.

    thenar       the version that recorded
    build        checksum of the build.json in use; empty: none was, and no predictions follow
    harness      text of the glove.toml
    switches     names of the switches, in the order of the frames' bits
    sensors      names of the CyberGlove's sensors, in wire order
    calibration  of the CyberGlove, if one was given
    policy       the rules of decisions; None: there were none
    collection   what was collected; None: an unlabelled run
    taxels       names of the taxels, in the order of the frames' codes
    taxel_calibration  of the taxels, if one was given
    clock_ns     nanoseconds since 1970 at which the monotonic clock of this session's frames was 0
    """

    thenar: str
    switches: Annotated[tuple[str, ...], msgspec.Meta(max_length=_MOST_SWITCHES)]
    sensors: Annotated[tuple[str, ...], msgspec.Meta(max_length=_MOST_SENSORS)]
    build: str = ""
    harness: str = ""
    calibration: GloveCalibration | None = None
    policy: Policy | None = None
    collection: Collection | None = None
    clock_ns: Number = 0
    taxels: Annotated[tuple[str, ...], msgspec.Meta(max_length=_MOST_SWITCHES)] = ()
    taxel_calibration: TaxelCalibration | None = None


def to_metadata(session: Session) -> dict[str, str]:
    """Return `session` as the keys and texts of a Metadata record."""
    return {"version": VERSION, "session": msgspec.json.encode(session).decode()}


def from_metadata(texts: dict[str, str]) -> Session:
    """Return the session that a Metadata record holds. Raises FormatError saying what is wrong."""
    if (version := texts.get("version", "")) != VERSION:
        found = f"it is of version {shortened(version, 20) or '?'}, this thenar reads {VERSION}"
        raise FormatError(f"{found}: use the thenar that recorded it")
    try:
        session = msgspec.json.decode(texts.get("session", ""), type=Session)
    except (ValueError, RecursionError) as wrong:
        raise FormatError(f"its session cannot be read: {shortened(str(wrong), 200)}") from None
    _check_names(session)
    return session


def _check_names(session: Session) -> None:
    names = {*session.switches, *session.sensors, *session.taxels}
    if (collected := session.collection) is not None:
        names |= {collected.subject, collected.taxonomy, *collected.types}
        names |= {name for task in collected.tasks for name in (task.grasp, *task.objects)}
    for name in sorted(names):
        if reason := fault(name):
            raise FormatError(f"its metadata name {shortened(repr(name))}, which {reason}")
