"""The report of a simulation: what came out for every grasp type, and what every step cost."""

import math
from collections.abc import Iterator, Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from ..pipeline.ledger import Ledger
from .notes import Notes, Unsettled
from .rows import Rows

Places = NDArray[np.intp]


class GraspReport(msgspec.Struct, frozen=True):
    """What came out for one grasp type. Switches are those closed at read-out, in grasps whose rows are in the set.

    repetitions  all that were made                  rows        in the set
    unsettled    of them, not settled                patterns    distinct sets of closed switches
    switches_mean, switches_least, switches_most     no_contact  grasps without any closed switch
    residual_n, residual_nmm  largest force and moment on the object that nothing balances, of the settled repetitions
    between_n    mean force that fell between the switches, of the same
    """

    grasp: str
    repetitions: int
    rows: int
    unsettled: int
    switches_mean: float
    switches_least: int
    switches_most: int
    patterns: int
    no_contact: int
    residual_n: float
    residual_nmm: float
    between_n: float


class Count(msgspec.Struct, frozen=True):
    """What a step counted: solver steps, bytes sent, ..."""

    what: str
    number: int


class StepReport(msgspec.Struct, frozen=True):
    """What a step cost: an effect's, or (`own`) one that every scene has. Seconds are summed over all workers.

    calls  batches      grasps  repetitions in them      draws  random numbers      share  of the time of all steps
    """

    name: str
    own: bool
    calls: int
    grasps: int
    draws: int
    seconds: float
    us_a_grasp: float
    share: float
    counts: tuple[Count, ...]


class Report(msgspec.Struct, frozen=True):
    """A simulation: what came out by grasp type, what each step cost, and what did not settle.

    simulated       True, so that nobody takes a result for a recording
    seconds         from start to end, on all workers
    lost_frames     frames that did not arrive
    kept_unsettled  whether repetitions that did not settle are in the set all the same
    """

    simulated: bool
    scene: str
    seed: int
    subjects: tuple[str, ...]
    repetitions: int
    rows: int
    seconds: float
    lost_frames: int
    kept_unsettled: bool
    unsettled: tuple[Unsettled, ...]
    grasps: tuple[GraspReport, ...]
    steps: tuple[StepReport, ...]


def grasp_reports(rows: Rows, grasps: Places, names: Sequence[str], notes: Sequence[Notes]) -> tuple[GraspReport, ...]:
    """Return a report a grasp type: `names` in order, `grasps` (m,) the type of each row."""
    made = [[note for note in notes if note.grasp == name] for name in names]
    return tuple(
        _grasp_report(name, rows.pick(np.flatnonzero(grasps == number)), made[number])
        for number, name in enumerate(names)
    )


def _grasp_report(name: str, rows: Rows, notes: Sequence[Notes]) -> GraspReport:
    bits = rows.bits[rows.read_out]
    closed = np.bitwise_count(bits).sum(axis=1, dtype=np.int64)
    settled = sum(note.repetitions - len(note.unsettled) for note in notes)
    return GraspReport(
        grasp=name,
        repetitions=sum(note.repetitions for note in notes),
        rows=len(rows),
        unsettled=sum(len(note.unsettled) for note in notes),
        switches_mean=float(closed.mean()) if len(closed) else 0.0,
        switches_least=int(closed.min()) if len(closed) else 0,
        switches_most=int(closed.max(initial=0)),
        patterns=len(np.unique(bits, axis=0)),
        no_contact=int(np.count_nonzero(closed == 0)),
        residual_n=max((note.residual_n for note in notes), default=0.0),
        residual_nmm=max((note.residual_nmm for note in notes), default=0.0),
        between_n=math.fsum(note.between_n for note in notes) / max(settled, 1),
    )


def step_reports(ledger: Ledger) -> Iterator[StepReport]:
    """Yield what each step cost, in the order in which they run."""
    shares = dict(ledger.shares())
    for name, entry in ledger.entries.items():
        yield StepReport(
            name=name,
            own=entry.own,
            calls=entry.calls,
            grasps=entry.grasps,
            draws=entry.draws,
            seconds=entry.nanoseconds / 1e9,
            us_a_grasp=entry.nanoseconds / 1e3 / entry.grasps,
            share=shares[name],
            counts=tuple(Count(what, number) for what, number in sorted(entry.counters.items())),
        )
