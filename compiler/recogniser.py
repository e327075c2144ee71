"""The recogniser: what a recipe makes of samples, for everything that compiles, evaluates or places.

If it was trained without rows in which nothing is held, it learns thresholds by which it rejects unfamiliar frames.
Three deviations say how far a frame lies outside the training rows of its candidate type: its score is below the lowest
score of the type's rows; its number of closed switches is outside their range; and some of its joints are outside the
ranges that hold all but TAIL of the type's rows at either end. The slack allowed for each deviation is learned from
inner folds, such that at most the requested share of held-out grasps is rejected. Deviations are comparable as ranks: a
frame is rejected for the rank of its rarest deviation, so one limit on ranks determines all three slacks.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from thenar.drivers.errors import ThenarError
from thenar.runtime.manifest import Fitting, Rejection
from thenar.runtime.model.integers import LIMIT, MAX_BYTES, MAX_JOINTS, MAX_SWITCHES, IntegerTables, least_bytes
from thenar.runtime.model.quantise import in_bytes, quantise
from thenar.runtime.model.terms.base import HIGHEST_CODE
from thenar.runtime.published import NONE
from thenar.runtime.recipe import Recipe
from thenar.runtime.scores import refused

from .artifact import CompileError
from .artifact.ensemble import model_fault
from .evaluation.choosing import choose_training, inner_folds
from .evaluation.folds import OF, leave_groups_out
from .model.collapse import collapse
from .model.faults import fit_lost
from .placement.constraints import Limits
from .placement.elements import Elements
from .placement.placement import InputSelection, select
from .placement.ports import PortCosts
from .samples import Samples
from .trainers.base import Model, Report, Training

Classes = NDArray[np.intp]
Scores = NDArray[np.float64]
Groups = NDArray[np.str_] | None

# Of kamakura's open hands that are taken for Add, 2 % were rejected with whole ranges, 58 % with 1 % cut off at either
# end, 43 % with 5 %: the narrower the ranges, the more joints of a held-out grasp are outside.
TAIL = 0.01


@dataclass(frozen=True, eq=False)
class Recogniser:
    """Kept elements and joints, a model of them, its integer tables, and the rule by which it rejects frames.

    Attributes
    ----------
    recipe : Recipe
        The choices that made it.
    samples : Samples
        The rows that it learnt from, with all inputs.
    selection : InputSelection
        The elements and joints that it reads.
    model : Model
        The additive model.
    training : Training
        How the model was trained.
    fitting : Fitting or None
        How the fit was chosen; None if it was chosen before.
    groups : ndarray or None
        For each row (n,), what is left out where it is to generalise to new subjects, objects or sessions.
    """

    recipe: Recipe
    samples: Samples
    selection: InputSelection
    model: Model
    training: Training
    fitting: Fitting | None = None
    groups: Groups = None

    @classmethod
    def fit(
        cls,
        samples: Samples,
        recipe: Recipe,
        rows: NDArray[np.intp] | None = None,
        *,
        ports: PortCosts | None = None,
        limits: Limits | None = None,
        groups: Groups = None,
        jobs: int = 1,
        report: Report | None = None,
    ) -> Self:
        """Choose elements, joints and the fit, and train: all from the same rows.

        Elements and joints are chosen to distinguish grasp types. Rows in which nothing is held are used only for the
        fit, and no more of them than there are rows of grasps.

        Parameters
        ----------
        samples : Samples
            The rows to learn from.
        recipe : Recipe
            The choices; what they leave open is chosen by inner folds.
        rows : ndarray, optional
            The numbers (m,) of those to learn from; None: all.
        ports : PortCosts, optional
            The costs of reading switches and taxels, for methods that use them.
        limits : Limits, optional
            Constraints on the placement.
        groups : ndarray, optional
            For each row (n,), what is left out where the fit is to generalise to new subjects, objects or sessions.
        jobs : int
            Worker processes that compare fits.
        report : callable, optional
            Called with (done, total) as the work proceeds.

        Raises
        ------
        CompileError
            If no input distinguishes grasp types.
        """
        if rows is not None:
            samples, groups = samples.rows(rows), None if groups is None else groups[rows]
        selection = select(samples.without_none(), recipe, ports, limits)
        if not selection.columns and not samples.codes.shape[1]:
            raise CompileError(
                "no switch is worth keeping: lower ``prune``, or record switches that differ between grasps"
            )
        balanced = samples.balanced()
        kept = selection.read(samples.rows(balanced))
        check_inputs(len(samples.grasps), len(selection.columns), len(selection.joints), CompileError)
        if not kept.varies:
            raise CompileError("no input differs between rows: nothing distinguishes the grasp types")
        candidates, of = Training.candidates(recipe), OF[recipe.by or "subject"]
        by = None if groups is None else groups[balanced]
        fitting = choose_training(kept, candidates, seed=recipe.seed, groups=by, of=of, jobs=jobs, report=report)
        training = Training.chosen(fitting, masked=recipe.robust)
        model = training.train(kept, report if len(candidates) == 1 else None)
        _check_model(model, kept, training)
        return cls(recipe, samples, selection, model, training, fitting, groups)

    @classmethod
    def stages(
        cls,
        samples: Samples,
        recipe: Recipe,
        rows: NDArray[np.intp],
        selection: InputSelection,
        training: Training,
        rounds: Sequence[int],
    ) -> tuple[Self, ...]:
        """Train once with inputs and a fit that were chosen before from the same rows, as `fit` chooses them; return
        the recogniser after each of these numbers of rounds. Several recipes share the work of choosing so.
        """
        samples = samples.rows(rows)
        kept = selection.read(samples.rows(samples.balanced()))
        models = training.stages(kept, rounds)
        for model in models:
            _check_model(model, kept, training)
        return tuple(cls(recipe, samples, selection, model, training) for model in models)

    @property
    def elements(self) -> Elements:
        """The kept elements, in the order in which they were chosen."""
        return self.selection.kept

    def read(self, samples: Samples) -> Samples:
        """Return these samples as a glove with only the kept elements and joints reads them."""
        return self.selection.read(samples)

    @cached_property
    def _learnt(self) -> Samples:
        return self.read(self.samples.rows(self.samples.balanced()))

    @cached_property
    def integers(self) -> IntegerTables:
        """The integer tables of the model; a lost input adds its mean."""
        kept = self._learnt
        tables = collapse(self.model, kept.n_switches)
        return quantise(tables, kept.switches, kept.codes, self.recipe.width, self.recipe.table_bits)

    @cached_property
    def tables(self) -> IntegerTables:
        """The integer tables, with fitted substitutes for lost inputs, as firmware stores them."""
        kept = self._learnt
        return in_bytes(fit_lost(self.integers, kept.switches, kept.codes, kept.labels))

    @cached_property
    def rejection(self) -> Rejection | None:
        """The rule by which it rejects frames; None if it rejects none.

        There is none either if nothing held is already a class, or if there are too few trials or only one group, so
        that the deviation of a new group cannot be estimated.
        """
        samples, recipe, groups = self.read(self.samples), self.recipe, self.groups
        if not recipe.refuse or samples.has_none or NONE in samples.grasps:
            return None
        several = 0 if groups is None else len(np.unique(groups))
        if several == 1:
            return None
        # Two groups suffice to compare fits on trials; the deviation of a new group needs folds by group.
        folds = leave_groups_out(groups, "group") if groups is not None and several == 2 else None
        deviations = []
        for fold in folds or inner_folds(samples, recipe.seed, groups):
            learnt = samples.rows(fold.train)
            # The drafts by which the fit was chosen.
            tables = collapse(self.training.draft(learnt), learnt.n_switches)
            integers = quantise(tables, learnt.switches, learnt.codes, recipe.width, recipe.table_bits)
            deviations.append(_Limits(learnt, integers).deviations(samples.rows(fold.test)))
        if not deviations:
            return None
        slacks = _slacks(np.concatenate(deviations), recipe.refuse)
        return _Limits(samples, self.integers).rejection(*slacks, recipe.refuse)

    def scores(self, samples: Samples) -> Scores:
        """Return the scores (m, K) of samples with all inputs, in units, as the integer tables give them.

        If frames can be rejected, column K is +infinity for rejected ones and -infinity for the others.
        """
        read = self.read(samples)
        scores = self.integers.scores(read.switches, read.codes)
        if self.rejection is None:
            return scores / self.integers.scale
        beyond = np.where(refused(self.rejection, scores, read.switches, read.codes), np.inf, -np.inf)
        return np.column_stack([scores / self.integers.scale, beyond])

    @property
    def rounds(self) -> int:
        """The number of boosting rounds in the model."""
        return self.model.n_rounds

    @property
    def stopped_after(self) -> int:
        """The number of rounds after which a tolerance ended the training; 0 if none did."""
        return self.rounds if self.model.stopped_early else 0

    @property
    def zero_gain_nodes(self) -> int:
        """The number of tree nodes at which no single switch gained anything."""
        tree = self.selection.tree
        return 0 if tree is None else tree.n_zero_gain


def _check_model(model: Model, kept: Samples, training: Training) -> None:
    if fault := model_fault(model, kept.n_switches, kept.codes.shape[1], kept.n_classes):
        raise CompileError(f"trainer {training.trainer!r} returned an invalid model that {fault}: fix the trainer")


def check_inputs(n_classes: int, elements: int, joints: int, raises: type[ThenarError]) -> None:
    """Raise `raises` if no build has room for these numbers of switches and joints."""
    if elements > MAX_SWITCHES:
        raise raises(f"{elements} switches, a build has at most {MAX_SWITCHES}: keep fewer")
    if joints > MAX_JOINTS:
        raise raises(f"{joints} joints, a build has at most {MAX_JOINTS}: import fewer, or use switches alone")
    least = least_bytes(n_classes, elements, joints)
    if least > MAX_BYTES:
        raise raises(
            f"tables of {n_classes} grasp types, {elements} switches and {joints} joints need {least} bytes at least, "
            f"a build has at most {MAX_BYTES}: keep fewer switches"
        )


def predicted_classes(
    tables: IntegerTables, rejection: Rejection | None, bits: NDArray[np.bool_], codes: NDArray[np.uint16]
) -> Classes:
    """Return the predicted classes (n,) of rows of kept switches (n, s) and codes (n, j); K: rejected."""
    scores = tables.scores(bits, codes)
    classes: Classes = scores.argmax(axis=1)
    if rejection is not None:
        classes[refused(rejection, scores, bits, codes)] = tables.n_classes
    return classes


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
            rows = samples.labels == label
            self.least[label] = scores[rows, label].min()
            self.closed[label] = closed[rows].min(), closed[rows].max()
            codes = np.sort(samples.codes[rows], axis=0)
            tail = int(TAIL * len(codes))
            self.ranges[label] = np.stack([codes[tail], codes[-1 - tail]], axis=1)

    def _scores(self, samples: Samples) -> Scores:
        scores: Scores = self._tables.scores(samples.switches, samples.codes) / self._tables.scale
        return scores

    def deviations(self, samples: Samples) -> Scores:
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
        tables = self._tables
        steps = [int(steps[-1]) + 1 for steps in map(tables.steps_of, range(tables.n_joints)) if len(steps)]
        if max([0, *steps, *(slope.high for slope in tables.lines)]) <= 255:
            # No code above 254 is distinguished, and boards that send bytes send 255 for all codes above it.
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


def _slacks(deviations: Scores, share: float) -> tuple[float, float, float]:
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
