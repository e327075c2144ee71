"""Notes: what is remembered of the repetitions of a batch beside their rows."""

import math
from dataclasses import dataclass

import msgspec
import numpy as np

from ..pipeline.batch import SLID_OUT_MM, Batch


class Unsettled(msgspec.Struct, frozen=True):
    """A repetition that cannot be trusted, and why."""

    subject: str
    grasp: str
    object: str
    repetition: int
    trial: int
    why: str


@dataclass(frozen=True, slots=True)
class Notes:
    """Of the repetitions of one grasp type in a batch: which did not settle, and of the others the largest force and
    moment on the object that nothing balances, the force between switches in all, and the frames that did not arrive.
    """

    grasp: str
    repetitions: int
    unsettled: tuple[Unsettled, ...]
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


def _unsettled(batch: Batch, row: int) -> Unsettled:
    condition = batch.condition
    return Unsettled(
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
    return f"the hand did not come to rest; left on the object: {force:.3g} N, {moment:.3g} N mm"
