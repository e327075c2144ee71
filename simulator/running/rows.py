"""Rows: what is kept of a batch, packed, and how all of them become a set of grasps."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.recordings.graspset import GraspSet, Joint
from thenar.compiler.recordings.taxonomy import Taxonomy

from ..body.condition import Condition
from ..pipeline.batch import Batch, Bits

Places = NDArray[np.intp]
Codes = NDArray[np.uint16]


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """m rows, s switches.

    bits      (m, ceil(s / 8)) uint8   eight switches to the byte, the first in the highest bit
    codes     (m, 16) uint16           the joints
    condition (m,) uint32              number of the condition
    trial     (m,) uint32              place in the subject's session
    read_out  (m,) bool                the row of its repetition that is read while the object is held
    """

    bits: NDArray[np.uint8]
    codes: Codes
    condition: NDArray[np.uint32]
    trial: NDArray[np.uint32]
    read_out: Bits

    def __len__(self) -> int:
        return len(self.bits)

    def pick(self, index: Places) -> "Rows":
        """Return the rows that `index` picks, in its order."""
        picked = (self.condition[index], self.trial[index], self.read_out[index])
        return Rows(self.bits[index], self.codes[index], *picked)


def rows_of(batch: Batch, kept: Places, number: int, codes: Codes, held: int, *, every_frame: bool) -> Rows:
    """Return the rows of the repetitions `kept` (k,) of a batch of condition `number`; codes (n, F, 16).

    One row a repetition, that of frame number `held`, or one a frame.
    """
    frames = np.arange(batch.bits.shape[1]) if every_frame else np.array([held])
    each = (np.repeat(kept, len(frames)), np.tile(frames, len(kept)))
    m = len(each[0])
    return Rows(
        bits=np.packbits(batch.bits[each], axis=1),
        codes=codes[each],
        condition=np.full(m, number, dtype=np.uint32),
        trial=batch.trials[each[0]].astype(np.uint32),
        read_out=each[1] == held,
    )


def joined(blocks: Sequence[Rows], subject: Places) -> Rows:
    """Return all rows by subject, trial and frame, however they were cut into blocks and in whichever order these came.

    subject (c,) is the place of each condition's subject in the scene; the frames of a repetition are in one block, in
    order.
    """
    whole = Rows(*(np.concatenate([getattr(block, field.name) for block in blocks]) for field in fields(Rows)))
    return whole.pick(np.lexsort((whole.trial, subject[whole.condition])))


def grasp_set(
    rows: Rows,
    conditions: Sequence[Condition],
    switches: tuple[str, ...],
    joints: tuple[Joint, ...],
    taxonomy: Taxonomy,
    simulated: str,
) -> GraspSet:
    """Return the set of grasps that `rows` of these conditions make; `simulated` says what made them."""
    bits = np.unpackbits(rows.bits, axis=1, count=len(switches)).view(np.bool_)
    bits.setflags(write=False)  # so that it is not copied
    grasps, subjects, objects = (
        np.array(names, dtype=np.str_)[rows.condition]
        for names in zip(*((each.grasp, each.subject, each.thing.name) for each in conditions), strict=True)
    )
    trials = rows.trial.astype(np.int64)
    read = (bits, switches, rows.codes, joints)
    return GraspSet(*read, grasps, taxonomy, subjects, objects, trials, simulated)
