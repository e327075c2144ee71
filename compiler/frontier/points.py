"""`frontier.json`: the points that were found, their costs and accuracies, and the best of them."""

from collections.abc import Callable, Iterator, Sequence
from typing import Annotated, Literal, TypeVar

import msgspec
from msgspec import Meta, Struct, field

from thenar.drivers.errors import ThenarError
from thenar.runtime.manifest import in_words
from thenar.runtime.names import fault, shortened
from thenar.runtime.recipe import PAPERS_TRAINER, Inputs, Name, TableBits, Value

from ..evaluation.rates import Rate
from ..placement.sensors import SENSORS

SCHEMA = 5
MAX_BYTES = 64 << 20

# measured: wall time on this machine. simulated: cycles of the real firmware in a simulator. wire: calculated from
# clocks and baud rates, validated against an emulated bus. model: predicted by a model validated against measurements.
# formula: the vendor's, from a single source. given: by the user. guess: measured elsewhere, times an assumed factor.
# unknown: left out of every sum.
How = Literal["measured", "simulated", "wire", "model", "formula", "given", "guess", "unknown"]
# The population of a rate: left-out subjects, or rows of all subjects in random folds of whole trials.
By = Literal["new subject", "pooled"]
Share = Annotated[float, Meta(ge=0.0, le=1.0)]
Count = Annotated[int, Meta(ge=0, le=2**53)]
# Microseconds; a day has 1e11 of them.
Microseconds = Annotated[float, Meta(ge=0.0, le=1e12)]
_T = TypeVar("_T")
WIDEST: TableBits = 16

# A point must be this much better than all cheaper or equal ones, a twentieth of a percent: less is a fold's noise.
STEP = 0.0005


class FrontierError(ThenarError, ValueError):
    """A frontier that cannot be computed as requested, or a file that is none."""


class PointTime(Struct, frozen=True, forbid_unknown_fields=True):
    """A time in microseconds, and its source."""

    us: Microseconds
    how: How


class PlacementChoice(Struct, frozen=True, forbid_unknown_fields=True):
    """A placement method: a name of `METHODS`, and its parameter (S, or a number of switches); or sensors."""

    method: str
    parameter: Annotated[float, Meta(ge=0.0, le=1e6)]


class PointSetting(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """All choices of a point: the input of `compile --from`.

    rounds      None for a trainer without rounds
    width       bits that every sum fits; table_bits: 8 if a byte is enough for an entry of a line
    wiring      "as wired" (the given glove.toml), "board" (one that prints rows) or a kind of port expander; clock_hz
                of its bus, or baud of the board's line; 0 if no switch is read
    trainer     of the model, and its `settings` that are not defaults; the paper's is not written
    keep_joints  number of joints that are read; None: all, if `inputs` has any
    levels      most levels of a taxel to choose from; None: there are no taxels, or none are read
    """

    placement: PlacementChoice
    inputs: Inputs
    rounds: Annotated[int, Meta(ge=1, le=10**6)] | None
    width: Annotated[int, Meta(ge=4, le=16)]
    wiring: str
    clock_hz: Annotated[int, Meta(ge=0, le=12_000_000)]
    table_bits: TableBits = field(default_factory=lambda: WIDEST)
    max_bins: Annotated[int, Meta(ge=2, le=2**53)] | None = field(default_factory=lambda: None)
    trainer: Name = PAPERS_TRAINER
    settings: dict[Name, Value] = {}
    keep_joints: Annotated[int, Meta(ge=1, le=2**16)] | None = None
    levels: Annotated[int, Meta(ge=1, le=65535)] | None = None

    @property
    def usual(self) -> bool:
        """Whether rounds and bins fully describe the training."""
        return self.trainer == PAPERS_TRAINER and not self.settings

    @property
    def settings_in_words(self) -> list[str]:
        """The settings of the trainer: ["joint-bins 5"]."""
        return [in_words(name, value) for name, value in self.settings.items()]


class FrontierPoint(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A design of the glove.

    number      the argument of `compile --from frontier.json --point`
    switches    names of the kept switches and levels, in the order in which they were chosen from all rows
    joints      names of the joints that are read, if not all or none
    rate        of new subjects, or pooled: the rate by which the point was chosen, corrected for luck
    luck        the optimism of picking the best of all that was tried (`evaluation.rates.Draws`)
    frames      the rate of single frames, uncorrected (None: a trial has one frame)
    other_rate  the other of the two, uncorrected (None: only one subject)
    adapted     the rates of new subjects before and after their `own_trials` of each type, on their other trials,
                uncorrected (None: not asked for)
    scan        reading the switches; transfer: the joints
    frame       max(scan, transfer) + classify: the two use separate lines
    flash, ram  bytes of the classifier on its target; of the tables alone on host and pi
    fronts      the fronts that it is on: "frame", "switches"
    """

    number: int
    setting: PointSetting
    switches: tuple[str, ...]
    rate: Rate
    luck: Share
    frames: Rate | None
    other_rate: Rate | None
    scan: PointTime
    transfer: PointTime
    classify: PointTime
    frame: PointTime
    flash: Count
    ram: Count
    ports: Count
    chips: Count
    fronts: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()
    adapted: tuple[Rate, Rate] | None = None

    @property
    def by_sensors(self) -> bool:
        """Whether it keeps the best sensors of a number: switches, pads and joints in one pool."""
        return self.setting.placement.method == SENSORS

    @property
    def size(self) -> int:
        """The number of its switches and levels, or of its sensors if it keeps the best of these."""
        return int(self.setting.placement.parameter) if self.by_sensors else len(self.switches)


class Tried(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A screened placement: its rate after `rounds` rounds (None: its trainer has none), in the fastest of its wirings;
    and its trainer, if that is not the paper's.
    """

    placement: PlacementChoice
    inputs: Inputs
    n_switches: Count
    rounds: Count | None
    rate: Rate
    frame_us: Microseconds
    trainer: Name = PAPERS_TRAINER
    keep_joints: Annotated[int, Meta(ge=1, le=2**16)] | None = None
    levels: Annotated[int, Meta(ge=1, le=65535)] | None = None


class ReferencePoint(Struct, frozen=True, forbid_unknown_fields=True):
    """A reference mark on the picture: the paper's choices, all switches, the user's build."""

    name: str
    n_switches: Count
    rate: Rate
    frame_us: Microseconds


class Frontier(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The result of `thenar frontier`.

    by       the rate by which points are chosen, which is each `rate`; a point's `other_rate` is the other
    machine  what classifies in the stated times, in words; measured ones are of this machine
    n_levels  most levels of the n_taxels to choose from, in addition to the switches
    picked   number of the point selected by the given budget or rate; None if neither was given
    have, never, price, prices  the limits of the sensors, if these were chosen
    own_trials  the number of trials of each type to which a new subject's model is adapted; 0: it is not
    skipped  sentences: measurements that were not possible here, and options that were left out
    """

    schema: int
    thenar: str
    source: str
    fingerprint: str
    rows: Count
    trials: Count
    subjects: Count
    by: By
    n_switches: Count
    n_joints: Count
    grasps: tuple[str, ...]
    target: str
    machine: str
    folds: Count
    repeats: Count
    combinations: Count
    points: tuple[FrontierPoint, ...]
    tried: tuple[Tried, ...]
    marks: tuple[ReferencePoint, ...]
    skipped: tuple[str, ...]
    picked: int | None = None
    wanted: str = ""
    n_taxels: Count = 0
    n_levels: Count = 0
    have: tuple[Name, ...] = ()
    never: tuple[Name, ...] = ()
    price: Value | None = None
    prices: dict[Name, Value] = {}
    own_trials: Count = 0

    @property
    def trainers(self) -> tuple[str, ...]:
        """The trainers that were tried."""
        return tuple(dict.fromkeys(each.trainer for each in self.tried))

    @property
    def guessed(self) -> bool:
        """Whether its times of frames are guesses."""
        return any(point.frame.how == "guess" for point in self.points)

    @property
    def other(self) -> By | None:
        """The kind of each point's `other_rate`."""
        if self.subjects < 2:
            return None
        return "pooled" if self.by == "new subject" else "new subject"

    def point(self, number: int) -> FrontierPoint:
        """Return the point with that number. Raises FrontierError."""
        for point in self.points:
            if point.number == number:
                return point
        raise FrontierError(f"there is no point {number}: the frontier has points 1 to {len(self.points)}")


def front(
    several: Sequence[_T], price: Callable[[_T], float], worth: Callable[[_T], float], step: float = STEP
) -> list[_T]:
    """Return the Pareto front, cheapest first: each is worth more, by `step`, than every cheaper one before it.

    Of equal prices the one worth most is taken, of equal worth too the first.
    """
    best: list[_T] = []
    for one in sorted(several, key=lambda one: (price(one), -worth(one))):
        if not best or worth(one) >= worth(best[-1]) + step:
            best.append(one)
    return best


def frontier_to_bytes(frontier: Frontier) -> bytes:
    """Return the content of `frontier.json`."""
    return msgspec.json.format(msgspec.json.encode(frontier), indent=2) + b"\n"


def frontier_from_bytes(data: bytes, what: str = "frontier.json") -> Frontier:
    """Return the frontier of a `frontier.json`; messages refer to it as `what`.

    Raises FrontierError if it is oversized, no such document, of another schema, or inconsistent.
    """
    if len(data) > MAX_BYTES:
        raise FrontierError(f"{what} has {len(data)} bytes, a frontier has at most {MAX_BYTES}")
    schema = _decode(data, dict[str, object], what).get("schema")
    if schema != SCHEMA:
        raise FrontierError(f"{what} has schema {schema}, this thenar reads {SCHEMA}: run thenar frontier again")
    frontier = _decode(data, Frontier, what)
    for name in {*frontier.grasps, *(name for point in frontier.points for name in point.switches)}:
        if reason := fault(name):
            raise FrontierError(f"{what}: the name {shortened(repr(name))} {reason}")
    for wrong in _contradictions(frontier):
        raise FrontierError(f"{what} {wrong}: run thenar frontier again")
    return frontier


def _contradictions(frontier: Frontier) -> Iterator[str]:
    """Yield inconsistencies, and settings that cannot be built."""
    if [point.number for point in frontier.points] != list(range(1, len(frontier.points) + 1)):
        yield "does not number its points 1, 2, 3 and so on"
    if frontier.picked is not None and not 1 <= frontier.picked <= len(frontier.points):
        yield f"picked point {frontier.picked}, which it does not have"
    rates = [rate for point in frontier.points for rate in (point.rate, point.frames, point.other_rate)]
    rates += [rate for point in frontier.points for rate in point.adapted or ()]
    rates += [each.rate for each in frontier.tried] + [mark.rate for mark in frontier.marks]
    if not all(rate is None or 0 <= rate.low <= rate.mean <= rate.high <= 1 for rate in rates):
        yield "has a rate that is no share"
    for point in frontier.points:
        if fault := _fault(point, frontier):
            yield f"has a point {point.number} that {fault}"


def _fault(point: FrontierPoint, frontier: Frontier) -> str:
    """Return the first contradiction in a point's setting, or ""."""
    setting = point.setting
    if len(set(point.switches)) < len(point.switches) or len(point.switches) > frontier.n_switches + frontier.n_levels:
        return "keeps a switch twice, or more than there are"
    if point.switches and not (setting.wiring and setting.clock_hz):
        return "has switches without a wiring or its clock"
    if (setting.inputs == "joints") != (not point.switches):
        return f"keeps {len(point.switches)} switches for inputs {setting.inputs!r}"
    return ""


def _decode(data: bytes, kind: type[_T], what: str) -> _T:
    try:
        return msgspec.json.decode(data, type=kind)
    except (ValueError, RecursionError) as wrong:
        raise FrontierError(f"{what} is not a frontier's: {wrong}") from None
