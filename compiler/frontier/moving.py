"""Train segments on whole movements: tables with a class for nothing held, and the costs of segments with them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.segmenting.model import SegmentModel
from thenar.runtime.tables import IntegerTables

from ..evaluation.folds import leave_groups_out, trial_folds
from ..placement.elements import Elements, bits_of
from ..recordings.graspset import GraspSet
from ..samples import Columns, Samples
from ..segmenting.learning import learnt
from ..segmenting.streams import TICK_US, SegmentingError, streams_of
from ..segmenting.streams import Stream as Ticks
from ..tables.quantise import integer_scores
from ..trainers.base import Training
from .price import Tabled, tables_of

Segmenting = tuple[IntegerTables, SegmentModel]


@dataclass(frozen=True, slots=True, eq=False)
class Moving:
    """Rows of whole movements, with those in which nothing is held, and the ticks of their streams."""

    samples: Samples
    ticks: tuple[Ticks, ...]
    seed: int

    @classmethod
    def of(cls, grasp_set: GraspSet, held: NDArray[np.intp], seed: int) -> "Moving | None":
        """Return the movements of some rows in which something is held; None if the set has no streams, or no rows in
        which nothing is held.

        A stream goes from one of these movements to the next only if no other lies between them.
        """
        none = grasp_set.is_none
        try:
            streams = streams_of(grasp_set) if none.any() else ()
        except SegmentingError:
            return None
        movements = grasp_set.movement_ids
        inside = np.isin(movements, movements[np.flatnonzero(~none)[held]])
        if not (none & inside).any():
            return None
        place, ticks = np.cumsum(inside) - 1, []
        for stream in streams:
            cuts = np.flatnonzero(np.diff(inside[stream.rows])) + 1
            for first, rows in zip([0, *cuts.tolist()], np.split(stream.rows, cuts), strict=True):
                if inside[rows[0]]:
                    start_us = stream.start_us + first * TICK_US
                    ticks.append(Ticks(stream.subject, stream.session, place[rows], start_us))
        return cls(Samples.of(grasp_set).rows(inside), tuple(ticks), seed)

    def reading(self, elements: Elements, joints: Columns) -> "Moving":
        """Return the same movements with these elements and joints."""
        return replace(self, samples=bits_of(self.samples, elements).with_joints(joints))

    def segmenting(self, columns: Columns, tables: Sequence[Tabled], training: Training) -> Mapping[Tabled, Segmenting]:
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
            test = samples.rows(fold.test).keeping(columns)
            for tabled, made in self._tables(fold.train, columns, tables, training):
                scores[tabled][fold.test] = integer_scores(made, test.switches, test.codes) / made.scale
        return {
            tabled: (made, learnt(self.ticks, samples.labels, scores[tabled], samples.n_types, made.scale, TICK_US))
            for tabled, made in self._tables(np.arange(len(samples.labels)), columns, tables, training)
        }

    def _tables(
        self, rows: NDArray[np.intp], columns: Columns, tables: Sequence[Tabled], training: Training
    ) -> list[tuple[Tabled, IntegerTables]]:
        own = rows[self.samples.rows(rows).balanced()]
        return [(tabled, made) for tabled, made, _ in tables_of(self.samples, own, columns, tuple(tables), training)]
