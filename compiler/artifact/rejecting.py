"""Thresholds by which a build rejects unfamiliar frames, when it was trained without rows in which nothing is held.

Three deviations say how far a frame lies outside the training rows of its candidate type: its score is below the lowest
score of the type's rows; its number of closed switches is outside their range; and some of its joints are outside the
ranges that hold all but TAIL of the type's rows at either end. The slack allowed for each deviation is learned from
inner folds, such that at most the requested share of held-out grasps is rejected. Deviations are comparable as ranks: a
frame is rejected for the rank of its rarest deviation, so one limit on ranks determines all three slacks.
"""

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.manifest import Rejection
from thenar.runtime.model.integers import LIMIT, IntegerTables
from thenar.runtime.model.quantise import quantise
from thenar.runtime.model.terms.base import HIGHEST_CODE
from thenar.runtime.published import NONE
from thenar.runtime.recipe import Recipe

from ..evaluation.choosing import inner_folds
from ..evaluation.folds import leave_groups_out
from ..model.collapse import collapse
from ..samples import Samples
from ..trainers.base import Training

Floats = NDArray[np.float64]

# Of kamakura's open hands that are taken for Add, 2 % were rejected with whole ranges, 58 % with 1 % cut off at either
# end, 43 % with 5 %: the narrower the ranges, the more joints of a held-out grasp are outside.
TAIL = 0.01


def rejection_of(
    samples: Samples, tables: IntegerTables, training: Training, options: Recipe, groups: NDArray[np.generic] | None
) -> Rejection | None:
    """Return the rejection rule of a build with these tables.

    Return None if none is already a class, nothing is to be rejected, or there are too few trials or only one group, so
    that the deviation of a new group cannot be estimated.

    samples   the rows that the tables were trained on, with the kept switches and joints
    training  how the tables were trained
    groups    for each row (n,), the group that inner folds leave out together
    """
    if not options.refuse or samples.has_none or NONE in samples.grasps:
        return None
    several = 0 if groups is None else len(np.unique(groups))
    if several == 1:
        return None
    # Two groups suffice to compare fits on trials; the deviation of a new group needs folds by group.
    folds = leave_groups_out(groups, "group") if groups is not None and several == 2 else None
    deviations = [
        _Limits(samples.rows(fold.train), _tables(samples.rows(fold.train), training, options)).deviations(
            samples.rows(fold.test)
        )
        for fold in folds or inner_folds(samples, options.seed, groups)
    ]
    if not deviations:
        return None
    slacks = _slacks(np.concatenate(deviations), options.refuse)
    return _Limits(samples, tables).rejection(*slacks, options.refuse)


def _tables(samples: Samples, training: Training, options: Recipe) -> IntegerTables:
    model = collapse(training.train(samples), samples.n_switches)
    return quantise(model, samples.switches, samples.codes, options.width, options.table_bits)


class _Limits:
    """Limits of each type in the training rows: lowest score (in units), range of closed switches, ranges of codes."""

    def __init__(self, samples: Samples, tables: IntegerTables) -> None:
        self._tables, self._k = tables, samples.n_classes
        scores, closed = self._scores(samples), samples.switches.sum(axis=1)
        n_joints = samples.codes.shape[1]
        # A type without rows keeps limits that no frame can exceed.
        self.least = np.full(self._k, -np.inf)
        self.closed = np.tile(np.array([0, samples.n_switches]), (self._k, 1))
        self.ranges = np.tile(np.array([0, HIGHEST_CODE]), (self._k, n_joints, 1))
        for label in np.unique(samples.labels).tolist():
            own = samples.labels == label
            self.least[label] = scores[own, label].min()
            self.closed[label] = closed[own].min(), closed[own].max()
            codes = np.sort(samples.codes[own], axis=0)
            tail = int(TAIL * len(codes))
            self.ranges[label] = np.stack([codes[tail], codes[-1 - tail]], axis=1)

    def _scores(self, samples: Samples) -> Floats:
        scores: Floats = self._tables.scores(samples.switches, samples.codes) / self._tables.scale
        return scores

    def deviations(self, samples: Samples) -> Floats:
        """Return how far each row lies beyond the limits of its candidate, (n, 3)."""
        scores, closed, codes = self._scores(samples), samples.switches.sum(axis=1), samples.codes
        best = scores.argmax(axis=1)
        low, high = np.moveaxis(self.ranges[best], 2, 0)
        outside = ((codes < low) | (codes > high)).sum(axis=1)
        fewest, most = self.closed[best].T
        counts = np.maximum(0, np.maximum(fewest - closed, closed - most))
        return np.column_stack([np.maximum(0, self.least[best] - scores.max(axis=1)), counts, outside])

    def rejection(self, score: float, closed: float, outside: float, share: float) -> Rejection:
        """Return these limits with the slack of each deviation."""
        least = np.floor(np.maximum(self.least - score, -LIMIT / self._tables.scale) * self._tables.scale)
        ranges = self.ranges.copy()
        if _byte_codes(self._tables):
            # Boards that send bytes send 255 for all codes above it.
            ranges[:, :, 0] = np.minimum(ranges[:, :, 0], 255)
            ranges[:, :, 1][ranges[:, :, 1] >= 255] = HIGHEST_CODE
        fewest, most = np.maximum(0, self.closed[:, 0] - int(closed)), self.closed[:, 1] + int(closed)
        return Rejection(
            share=share,
            least_scores=tuple(least.astype(int).tolist()),
            closed=tuple(zip(fewest.tolist(), most.tolist(), strict=True)),
            ranges=tuple(tuple((low, high) for low, high in each) for each in ranges.tolist()),
            outside=int(outside),
        )


def _byte_codes(tables: IntegerTables) -> bool:
    """Return whether no joint's thresholds or slope distinguish codes above 254."""
    steps = [int(steps[-1]) + 1 for steps in map(tables.steps_of, range(tables.n_joints)) if len(steps)]
    return max([0, *steps, *(slope.high for slope in tables.slopes)]) <= 255


def _slacks(deviations: Floats, share: float) -> tuple[float, float, float]:
    """Return the limit of each deviation such that at most `share` of the rows (n, 3) exceed one of them."""
    n = len(deviations)
    sorted_ = np.sort(deviations, axis=0)
    # The number of rows that deviate by as much or more: a small number is a rare deviation.
    ranks = np.column_stack(
        [n - np.searchsorted(column, own) for column, own in zip(sorted_.T, deviations.T, strict=True)]
    )
    limit = np.sort(ranks.min(axis=1))[int(share * n)]
    score, closed, outside = (float(own[rank >= limit].max()) for own, rank in zip(deviations.T, ranks.T, strict=True))
    return score, closed, outside
