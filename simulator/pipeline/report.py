"""The results of a simulation: rows of a set of grasps, and a report of the results and their cost."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.compiler.recordings.graspset import GraspSet, Joint
from thenar.compiler.recordings.taxonomy import Taxonomy
from thenar.runtime.published import NONE, Count

from ..body.condition import Condition
from .batch import SLID_OUT_MM, Batch, Bits
from .effect import SceneSetting, frame_times, hold_frame
from .steps import Ledger


class UnsettledGrasp(msgspec.Struct, frozen=True):
    """A repetition that cannot be trusted, and why."""

    subject: str
    grasp: str
    object: str
    repetition: int
    trial: int
    why: str


@dataclass(frozen=True, slots=True)
class Notes:
    """Notes on the repetitions of one grasp type in a batch: the unsettled ones, and of the others the largest
    unbalanced force and moment on the object, the total force between switches, and the lost frames.
    """

    grasp: str
    repetitions: int
    unsettled: tuple[UnsettledGrasp, ...]
    residual_n: float
    residual_nmm: float
    between_n: float
    lost_frames: int


def notes_of(batch: Batch) -> Notes:
    """Return the notes on a batch that went through the pipeline."""
    settled = batch.settled
    return Notes(
        grasp=batch.condition.grasp,
        repetitions=len(batch),
        unsettled=tuple(_unsettled(batch, int(row)) for row in np.flatnonzero(~settled)),
        residual_n=float(batch.residual_n[settled].max(initial=0.0)),
        residual_nmm=float(batch.residual_nmm[settled].max(initial=0.0)),
        between_n=math.fsum(batch.between_n[settled].tolist()),
        lost_frames=0 if batch.lost is None else int(np.count_nonzero(batch.lost[settled])),
    )


def _unsettled(batch: Batch, row: int) -> UnsettledGrasp:
    condition = batch.condition
    return UnsettledGrasp(
        subject=condition.subject,
        grasp=condition.grasp,
        object=condition.thing.name,
        repetition=int(batch.repetitions[row]),
        trial=int(batch.trials[row]),
        why=_why(batch, row),
    )


def _why(batch: Batch, row: int) -> str:
    if batch.lost is not None and batch.lost[row].all():
        return "no frame arrived whole"
    slid = batch.slid_mm()[row]
    if slid > SLID_OUT_MM:
        return f"the object slid {slid:.0f} mm, out of the hand"
    force, moment = batch.residual_n[row], batch.residual_nmm[row]
    return f"the hand did not come to rest; residual on the object: {force:.3g} N, {moment:.3g} N mm"


Places = NDArray[np.intp]
Codes = NDArray[np.uint16]


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """m rows, s switches.

    bits      (m, ceil(s / 8)) uint8   eight places to the byte, the first in the highest bit
    codes     (m, 16) uint16           the joints
    taxels    (m, t) uint16
    condition (m,) uint32              number of the condition
    trial     (m,) uint32              index in the subject's session
    read_out  (m,) bool                the row of its repetition that is read while the object is held
    held      (m,) bool                whether anything is held
    time_us   (m,) int64               on the subject's clock, movement after movement
    """

    bits: NDArray[np.uint8]
    codes: Codes
    taxels: Codes
    condition: NDArray[np.uint32]
    trial: NDArray[np.uint32]
    read_out: Bits
    held: Bits
    time_us: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.bits)

    def pick(self, index: Places) -> "Rows":
        """Return the rows that `index` picks, in its order."""
        return Rows(*(getattr(self, field.name)[index] for field in fields(Rows)))


def rows_of(batch: Batch, kept: Places, number: int, codes: Codes, setting: SceneSetting) -> Rows:
    """Return the rows of the repetitions `kept` (k,) of a batch of condition `number`; codes (n, F, 16).

    One row a repetition, that of the frame that is read out, or one a frame.
    """
    read_out, times = hold_frame(setting), frame_times(setting)
    frames = np.arange(len(times)) if setting.every_frame else np.array([read_out])
    clock_us = batch.frame_us - times[0] + (batch.trials * len(times) * setting.period_us)[:, None]
    place = (np.repeat(kept, len(frames)), np.tile(frames, len(kept)))
    m = len(place[0])
    return Rows(
        bits=np.packbits(batch.bits[place], axis=1),
        codes=codes[place],
        taxels=np.zeros((m, 0), np.uint16) if batch.taxels is None else batch.taxels[place],
        condition=np.full(m, number, dtype=np.uint32),
        trial=batch.trials[place[0]].astype(np.uint32),
        read_out=place[1] == read_out,
        held=batch.holds(setting.let_go_us)[place],
        time_us=clock_us[place],
    )


def joined(blocks: Sequence[Rows], subject: Places) -> Rows:
    """Return all rows by subject, trial and frame, for any division into blocks and any order of these.

    subject (c,) is the index of each condition's subject in the scene; the frames of a repetition are in one block, in
    order.
    """
    whole = Rows(*(np.concatenate([getattr(block, field.name) for block in blocks]) for field in fields(Rows)))
    return whole.pick(np.lexsort((whole.trial, subject[whole.condition])))


def grasp_set(
    rows: Rows,
    conditions: Sequence[Condition],
    places: tuple[str, ...],
    taxels: tuple[Joint, ...],
    joints: tuple[Joint, ...],
    taxonomy: Taxonomy,
    simulated: str,
    *,
    timed: bool,
) -> GraspSet:
    """Return the set of grasps of `rows` of these conditions; `simulated` is their origin.

    With `timed` the rows have their times; a clock never goes back, and begins at 0. Places of the glove that are not
    taxels are switches.
    """
    bits = np.unpackbits(rows.bits, axis=1, count=len(places)).view(np.bool_)
    bits = bits if not taxels else bits[:, ~np.isin(places, [taxel.name for taxel in taxels])]
    switches = tuple(place for place in places if place not in {taxel.name for taxel in taxels})
    bits.setflags(write=False)  # so that it is not copied
    grasps, subjects, objects = (
        np.array(names, dtype=np.str_)[rows.condition]
        for names in zip(*((one.grasp, one.subject, one.thing.name) for one in conditions), strict=True)
    )
    clock_us = np.maximum(rows.time_us, 0)
    for subject in np.unique(subjects):
        recorded = subjects == subject
        clock_us[recorded] = np.maximum.accumulate(clock_us[recorded])
    return GraspSet(
        bits,
        switches,
        rows.codes,
        joints,
        np.where(rows.held, grasps, NONE),
        taxonomy,
        subjects,
        objects,
        rows.trial.astype(np.int64),
        simulated,
        taxels=rows.taxels,
        taxel_columns=taxels,
        times_us=clock_us if timed else clock_us[:0],
    )


class GraspReport(msgspec.Struct, frozen=True):
    """The results for one grasp type. Switches are those closed at read-out, in grasps whose rows are in the set.

    repetitions  all simulated ones                  rows        in the set, with something held
    unsettled    of them, not settled                patterns    distinct sets of closed switches
    switches_mean, switches_least, switches_most     no_contact  grasps without any closed switch
    residual_n, residual_nmm  largest unbalanced force and moment on the object, of the settled repetitions
    between_n    mean force between the switches, of the same
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


class StepReport(msgspec.Struct, frozen=True):
    """The cost of a step: an effect, or (`own`) one that every scene has. Seconds are summed over all workers.

    calls  batches      grasps  repetitions in them      draws  random numbers      share  of the time of all steps
    counts  of the step's own: solver steps, bytes sent, ...
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


class SimulationReport(msgspec.Struct, frozen=True):
    """A simulation: results by grasp type, costs of steps, and unsettled repetitions.

    simulated       True, so that a result is not mistaken for a recording
    done            earlier repetitions of each grasp type
    seconds         from start to end, on all workers
    lost_frames     frames that did not arrive
    kept_unsettled  whether unsettled repetitions are in the set
    """

    simulated: bool
    scene: str
    seed: int
    done: int
    subjects: tuple[str, ...]
    repetitions: int
    rows: int
    seconds: float
    lost_frames: int
    kept_unsettled: bool
    unsettled: tuple[UnsettledGrasp, ...]
    grasps: tuple[GraspReport, ...]
    steps: tuple[StepReport, ...]


def grasp_reports(rows: Rows, grasps: Places, names: Sequence[str], notes: Sequence[Notes]) -> tuple[GraspReport, ...]:
    """Return one report per grasp type: `names` in order, `grasps` (m,) the type of each row."""
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
    """Yield the cost of each step, in their order."""
    total = ledger.nanoseconds
    for name, entry in ledger.entries.items():
        yield StepReport(
            name=name,
            own=entry.own,
            calls=entry.calls,
            grasps=entry.grasps,
            draws=entry.draws,
            seconds=entry.nanoseconds / 1e9,
            us_a_grasp=entry.nanoseconds / 1e3 / entry.grasps,
            share=entry.nanoseconds / total if total else 0.0,
            counts=tuple(Count(what, number) for what, number in sorted(entry.counters.items())),
        )
