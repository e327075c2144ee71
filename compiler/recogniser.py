"""The recogniser: what a recipe makes of samples, for everything that compiles, evaluates or places."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.manifest import Fitting, Rejection
from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.model.quantise import quantise
from thenar.runtime.recipe import Recipe
from thenar.runtime.rejection import refused

from .artifact import CompileError
from .artifact.ensemble import model_fault
from .artifact.rejecting import rejection_of
from .evaluation.choosing import choose_training
from .evaluation.folds import OF
from .limits import check_inputs
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
    fitting : Fitting or None
        How the fit was chosen; None for an estimator's model.
    training : Training or None
        How the model was trained; None for an estimator's.
    groups : ndarray or None
        For each row (n,), what is left out where it is to generalise to new subjects, objects or sessions.
    """

    recipe: Recipe
    samples: Samples
    selection: InputSelection
    model: Model
    fitting: Fitting | None = None
    training: Training | None = None
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
        return cls(recipe, samples, selection, model, fitting, training, groups)

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
        return tuple(cls(recipe, samples, selection, model, training=training) for model in models)

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
        """The integer tables, with fitted substitutes for lost inputs."""
        kept = self._learnt
        return fit_lost(self.integers, kept.switches, kept.codes, kept.labels)

    @cached_property
    def rejection(self) -> Rejection | None:
        """The rule by which it rejects frames; None if it rejects none, and for an estimator's model."""
        if self.training is None:
            return None
        return rejection_of(self.read(self.samples), self.integers, self.training, self.recipe, self.groups)

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


def predicted_classes(
    tables: IntegerTables, rejection: Rejection | None, bits: NDArray[np.bool_], codes: NDArray[np.uint16]
) -> Classes:
    """Return the predicted classes (n,) of rows of kept switches (n, s) and codes (n, j); K: rejected."""
    scores = tables.scores(bits, codes)
    found: Classes = scores.argmax(axis=1)
    if rejection is not None:
        found[refused(rejection, scores, bits, codes)] = tables.n_classes
    return found
