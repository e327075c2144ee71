"""The paper's tables: cells of accuracies, computed from predictions."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import fmean
from typing import Self

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.manifest import Of

from ..samples import Samples, decided
from .folds import ProtocolName, Rows
from .plan import REFERENCE, CellPlan, FoldFit, Labels, RowPlan, TableName
from .rates import Paired, Rate, RecipeWords, interval, rated

Predictions = Mapping[FoldFit, Labels]
Confusion = tuple[tuple[int, ...], ...]

_TITLES: dict[TableName, str] = {
    "compositions": "Compositions of inputs (the paper's Tables II and V)",
    "generality": "One subject's placement (row) on another's data (column), selected switches (Tables III and VI)",
    "pruning": "Placement of all subjects pooled, pruned by S, selected switches (Tables IV and VII)",
    "baselines": "ID3 compared with other placements of as many switches, selected switches",
    "trainers": f"Trainers, their settings chosen from the training rows, and baselines; paired with {REFERENCE}",
}


@dataclass(frozen=True, slots=True)
class Spread:
    """Minimum, mean and maximum of a quantity that may differ between folds."""

    least: float
    mean: float
    most: float

    @classmethod
    def of(cls, values: Iterable[float]) -> Self:
        """Return the spread of one or more values."""
        listed = list(values)
        return cls(min(listed), fmean(listed), max(listed))

    def __str__(self) -> str:
        """Return "33", or "31 to 35"."""
        return f"{self.least:g}" if self.least == self.most else f"{self.least:g} to {self.most:g}"


@dataclass(frozen=True, slots=True)
class Cell:
    """The accuracy of one row of a table on one population.

    rate       by trials; frames: by frames, None if each row is a trial
    switches   the number of switches                        draws  spread over random draws, else None
    no_inputs  fits without any varying input: they predict the most frequent grasp type of their training rows
    confusion  (K, K) counts of trials over all repeats, row: true, column: predicted, K as in Study.grasps; only for
               compositions
    """

    rate: Rate
    frames: Rate | None
    switches: Spread
    no_inputs: int
    draws: Spread | None
    confusion: Confusion | None

    def __str__(self) -> str:
        """Return the rates in percent, starred if fits had no inputs; the draws' spread on a separate line."""
        draws = "" if self.draws is None else f"\nfrom {100 * self.draws.least:.1f} to {100 * self.draws.most:.1f}"
        return f"{both(self.rate, self.frames, '*' if self.no_inputs else '')}{draws}"


def both(rate: Rate, frames: Rate | None, mark: str = "") -> str:
    """Return a rate by trials in percent, with a mark; and on a second line the rate by frames, if there is one."""
    return f"{interval(rate)}{mark}" + ("" if frames is None else f"\n{interval(frames)} frames")


@dataclass(frozen=True, slots=True)
class RateRow:
    """A row of a table: its short name, its description, its switches, its cells, and the rate over all trials.

    frames is the rate over all frames, None if each row is a trial; paired compares the trials with those of the
    REFERENCE trainer on the same inputs, in the table of trainers.
    """

    name: str
    what: str
    switches: Spread
    cells: tuple[Cell, ...]
    rate: Rate
    frames: Rate | None
    paired: Paired | None = None


@dataclass(frozen=True, slots=True)
class RateTable:
    """A table in the paper's layout: a column per subject."""

    name: TableName
    protocol: ProtocolName
    recipe: RecipeWords
    columns: tuple[str, ...]
    rows: tuple[RateRow, ...]

    @property
    def title(self) -> str:
        """The title: what the table shows, what its rates are of, and by which recipe."""
        return f"{_TITLES[self.name]}: {self.protocol} protocol, {self.rows[0].rate.what}; {self.recipe}"

    @property
    def note(self) -> str:
        """A sentence on the meaning of a star; "" if there is none."""
        starred = any(cell.no_inputs for row in self.rows for cell in row.cells)
        return "* In some folds no input varied: there, the most frequent grasp type is predicted." if starred else ""


@dataclass(frozen=True, slots=True)
class RateReader:
    """Computes rates from predictions.

    samples      all rows
    predictions  of each fit
    of           what the rates are of, with the group (n,) that each row is left out with, None: its trial
    """

    samples: Samples
    predictions: Predictions
    of: Of
    groups: NDArray[np.str_] | None

    def table(
        self, name: TableName, protocol: ProtocolName, plans: Sequence[RowPlan], recipe: RecipeWords
    ) -> RateTable:
        """Return the table for these rows, which were fitted by this recipe."""
        columns = tuple(cell.population.name for cell in plans[0].cells)
        rows = [self._row(plan, confusing=name == "compositions") for plan in plans]
        if name == "trainers":
            hits = [self.hits(plan.cells) for plan in plans]
            first = {plan.what: correct for plan, correct in zip(plans, hits, strict=True) if plan.name == REFERENCE}
            rows = [
                row if row.name == REFERENCE else replace(row, paired=Paired.of(correct, first[row.what], REFERENCE))
                for row, correct in zip(rows, hits, strict=True)
            ]
        return RateTable(name, protocol, recipe, columns, tuple(rows))

    def _row(self, plan: RowPlan, *, confusing: bool) -> RateRow:
        cells = tuple(self.cell(cell, confusing=confusing) for cell in plan.cells)
        spreads = [cell.switches for cell in cells]
        switches = Spread(min(s.least for s in spreads), fmean(s.mean for s in spreads), max(s.most for s in spreads))
        rate, frames = (cells[0].rate, cells[0].frames) if len(cells) == 1 else self.rates(plan.cells)
        return RateRow(plan.name, plan.what, switches, cells, rate, frames)

    def cell(self, plan: CellPlan, *, confusing: bool) -> Cell:
        """Return the cell of a plan, with its confusion matrix if `confusing`."""
        rate, frames = self.rates((plan,))
        repeats, draws = len(plan.population.repeats), None
        if len(plan.runs) > repeats:
            draws = Spread.of((np.reshape(rate.correct, (-1, repeats)).mean(axis=1) / rate.total).tolist())
        counts = [len(fit.elements) for fit in plan.fits]
        blind = sum(fit.is_blind(self.samples) for fit in plan.fits)
        return Cell(rate, frames, Spread.of(counts), blind, draws, self._confusion(plan) if confusing else None)

    def rates(self, plans: Sequence[CellPlan]) -> tuple[Rate, Rate | None]:
        """Return the rates by trials and by frames of some cells together; their runs correspond."""
        rows, predicted = self._predicted(plans)
        groups = None if self.groups is None else self.groups[rows]
        repeats = len(plans[0].population.repeats)
        return rated(
            predicted,
            self.samples.labels[rows],
            self.samples.trials[rows],
            of=self.of,
            groups=groups,
            repeats_a_draw=repeats if len(predicted) > repeats else 1,
        )

    def hits(self, plans: Sequence[CellPlan]) -> NDArray[np.bool_]:
        """Return the correct trials (runs, m) of some cells in each run, in the order of the trials' numbers."""
        labels, predicted = self._decided(plans)
        return np.asarray(predicted == labels)

    def _confusion(self, plan: CellPlan) -> Confusion:
        labels, predicted = self._decided((plan,))
        counts = np.zeros((self.samples.n_classes,) * 2, dtype=np.intp)
        np.add.at(counts, (np.broadcast_to(labels, predicted.shape), predicted), 1)
        return tuple(map(tuple, counts.tolist()))

    def _decided(self, plans: Sequence[CellPlan]) -> tuple[Labels, Labels]:
        """Return the label (m,) of each trial that some cells test, and the one (runs, m) that each run predicts."""
        rows, predicted = self._predicted(plans)
        _, first, trial = np.unique(self.samples.trials[rows], return_index=True, return_inverse=True)
        return self.samples.labels[rows[first]], decided(predicted, trial)

    def _predicted(self, plans: Sequence[CellPlan]) -> tuple[Rows, Labels]:
        """Return the rows (n,) that some cells test, and the label (runs, n) that each run predicts for them."""
        rows = np.concatenate([fit.fold.test for plan in plans for fit in plan.runs[0]])
        predicted = np.zeros((len(plans[0].runs), len(self.samples.labels)), dtype=np.intp)
        for plan in plans:
            for run, fits in enumerate(plan.runs):
                for fit in fits:
                    predicted[run, fit.fold.test] = self.predictions[fit]
        return rows, predicted[:, rows]
