"""The tables as results: rates with their intervals, from the predictions of the planned fits."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from statistics import fmean
from typing import Self

import numpy as np

from ..text import interval
from .fits import Fit, Labels
from .plan import CellPlan, RowPlan, TableName, TablePlan
from .protocols import ProtocolName
from .rates import Average, Rate

Predictions = Mapping[Fit, Labels]
Confusion = tuple[tuple[int, ...], ...]

_TITLES: dict[TableName, str] = {
    "compositions": "Compositions of inputs (the paper's Tables II and V)",
    "generality": "One subject's placement (row) on another's data (column), selected switches (Tables III and VI)",
    "pruning": "Placement of all subjects pooled, pruned by S, selected switches (Tables IV and VII)",
    "baselines": "ID3 beside other placements of as many switches, selected switches",
}


@dataclass(frozen=True, slots=True)
class Spread:
    """Least, mean and most of something that may differ from fold to fold."""

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
    """The rate of one row of a table on one population.

    switches   how many switches the classifiers had         draws  spread of the rates of random draws; else None
    no_inputs  fits without any input that varies: they answer the most frequent grasp type of their training rows
    confusion  (K, K) counts over all repeats, row: true, column: recognised, K as in Study.grasps; None but for
               compositions
    """

    rate: Rate
    switches: Spread
    no_inputs: int
    draws: Spread | None
    confusion: Confusion | None

    def __str__(self) -> str:
        """Return rate and interval in percent, starred where fits had no inputs; the draws' spread on a second line."""
        draws = "" if self.draws is None else f"\nfrom {100 * self.draws.least:.1f} to {100 * self.draws.most:.1f}"
        return f"{interval(self.rate)}{'*' if self.no_inputs else ''}{draws}"


@dataclass(frozen=True, slots=True)
class Row:
    """A row of a table: its short name, what it is, its switches, its cells and their average."""

    name: str
    what: str
    switches: Spread
    cells: tuple[Cell, ...]
    average: Average


@dataclass(frozen=True, slots=True)
class Table:
    """A table in the paper's layout: a column a subject."""

    name: TableName
    protocol: ProtocolName
    columns: tuple[str, ...]
    rows: tuple[Row, ...]

    @property
    def title(self) -> str:
        """What the table shows."""
        return f"{_TITLES[self.name]}: {self.protocol} protocol"

    @property
    def note(self) -> str:
        """What a star means, in a sentence; "" where there is none."""
        starred = any(cell.no_inputs for row in self.rows for cell in row.cells)
        return "* In some folds no input varied: there, the most frequent grasp type is answered." if starred else ""


@dataclass(frozen=True, slots=True)
class Reader:
    """Reads rates off predictions: the true labels (n,), the labels that occur, the number of switches, and which fits
    were blind.
    """

    labels: Labels
    grasps: tuple[int, ...]
    n_switches: int
    predictions: Predictions
    blind: frozenset[Fit]

    def table(self, plan: TablePlan) -> Table:
        """Return the table of a plan."""
        columns = tuple(cell.part.name for cell in plan.rows[0].cells)
        rows = tuple(self._row(row, confusing=plan.name == "compositions") for row in plan.rows)
        return Table(plan.name, plan.protocol, columns, rows)

    def cell(self, plan: CellPlan, *, confusing: bool) -> Cell:
        """Return the cell of a plan, with its confusion matrix if `confusing`."""
        correct = tuple(sum(map(self._correct, run)) for run in plan.runs)
        repeats = len(plan.part.repeats)
        rate = Rate.of(correct, plan.part.total, repeats if len(correct) > repeats else 1)
        counts = [sum(column < self.n_switches for column in fit.columns) for fit in plan.fits]
        blind = sum(fit in self.blind for fit in plan.fits)
        confusion = self._confusion(plan.fits) if confusing else None
        return Cell(rate, Spread.of(counts), blind, _draws(rate, repeats), confusion)

    def _row(self, plan: RowPlan, *, confusing: bool) -> Row:
        cells = tuple(self.cell(cell, confusing=confusing) for cell in plan.cells)
        spreads = [cell.switches for cell in cells]
        switches = Spread(min(s.least for s in spreads), fmean(s.mean for s in spreads), max(s.most for s in spreads))
        return Row(plan.name, plan.what, switches, cells, Average.of(tuple(cell.rate for cell in cells)))

    def _correct(self, fit: Fit) -> int:
        return int(np.count_nonzero(self.predictions[fit] == self.labels[fit.fold.test]))

    def _confusion(self, fits: list[Fit]) -> Confusion:
        counts = np.zeros((len(self.grasps), len(self.grasps)), dtype=np.intp)
        for fit in fits:
            true = np.searchsorted(self.grasps, self.labels[fit.fold.test])
            np.add.at(counts, (true, np.searchsorted(self.grasps, self.predictions[fit])), 1)
        return tuple(map(tuple, counts.tolist()))


def _draws(rate: Rate, repeats: int) -> Spread | None:
    """Return the spread of the draws' own rates, each over its `repeats`; None if there is one draw only."""
    if len(rate.correct) == repeats:
        return None
    draws = np.reshape(rate.correct, (-1, repeats)).mean(axis=1) / rate.total
    return Spread.of(draws.tolist())
