"""Train segments on whole movements: tables with a class for nothing held, and the costs of segments with them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.segmenting.model import SegmentModel
from thenar.runtime.tables import IntegerTables

from ..evaluation.folds import leave_groups_out, trial_folds
from ..movements.learning import learnt
from ..movements.streams import TICK_US, MovementError, Stream, streams_of
from ..placement.placement import InputSelection
from ..recordings.graspset import GraspSet
from ..samples import Samples
from ..tables.quantise import integer_scores
from ..trainers.base import Training
from .price import Tabled, tables_of

SegmentTables = tuple[IntegerTables, SegmentModel]


@dataclass(frozen=True, slots=True, eq=False)
class MovementSamples:
    """Rows of movements, with those in which nothing is held, and their streams."""

    samples: Samples
    streams: tuple[Stream, ...]
    seed: int

    @classmethod
    def of(cls, grasp_set: GraspSet, rows: NDArray[np.intp], seed: int) -> "MovementSamples | None":
        """Return the movements of some of the rows with a grasp; None if the set has no streams, or all rows have one.

        A stream goes from one of these movements to the next only if no other lies between them.
        """
        none = grasp_set.is_none
        try:
            recorded = streams_of(grasp_set) if none.any() else ()
        except MovementError:
            return None
        movements = grasp_set.movement_ids
        inside = np.isin(movements, movements[np.flatnonzero(~none)[rows]])
        if not (none & inside).any():
            return None
        place, streams = np.cumsum(inside) - 1, list[Stream]()
        for stream in recorded:
            cuts = (np.flatnonzero(np.diff(inside[stream.rows])) + 1).tolist()
            parts = [stream.part(*ends) for ends in pairwise([0, *cuts, len(stream)])]
            streams += [replace(part, rows=place[part.rows]) for part in parts if inside[part.rows[0]]]
        return cls(Samples.of(grasp_set).rows(inside), tuple(streams), seed)

    def segment_tables(
        self, selection: InputSelection, tables: Sequence[Tabled], training: Training
    ) -> Mapping[Tabled, SegmentTables]:
        """Return tables of these rows with a class for nothing held, and the costs of segments, for each of `tables`.

        The costs are selected on the scores of two folds of these rows, which split no movement, and no subject if
        there are several.
        """
        samples, subjects = self.samples, self.samples.subjects
        if np.ptp(subjects):
            folds = leave_groups_out(subjects, "subject", 2)
        else:
            folds = trial_folds(samples.labels, samples.movements, 2, self.seed)
        scores = {tabled: np.zeros((len(samples.labels), samples.n_classes)) for tabled in tables}
        for fold in folds:
            test = selection.read(samples.rows(fold.test))
            for tabled, made, _ in tables_of(samples, fold.train, selection, tuple(tables), training):
                scores[tabled][fold.test] = integer_scores(made, test.switches, test.codes) / made.scale
        return {
            tabled: (made, learnt(self.streams, samples.labels, scores[tabled], samples.n_types, made.scale, TICK_US))
            for tabled, made, _ in tables_of(
                samples, np.arange(len(samples.labels)), selection, tuple(tables), training
            )
        }
