"""An evaluation: the paper's tables for the user's own recordings, from fits that are each done once."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from statistics import fmean
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.manifest import Of
from thenar.runtime.manifest import Options as Manifested

from ..limits import check_memory, check_types
from ..placement.methods.base import METHODS
from ..recordings.graspset import GraspSet
from ..samples import Samples, decided
from ..text import counted, interval
from ..trainers.base import Training, changed
from .folds import EvaluationError, Rows
from .plan import (
    RIVALS,
    CellPlan,
    FoldFit,
    Labels,
    Planner,
    Progress,
    RowPlan,
    TableName,
    inputs,
    is_blind,
    run_fits,
)
from .populations import OF, PROTOCOLS, Population, ProtocolName, Scheme, concerns, groups_of, populations
from .rates import Rate, rated

Predictions = Mapping[FoldFit, Labels]
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

    rate       of trials; frames: of frames, None where each row is a trial
    switches   how many switches the classifiers had         draws  spread of the rates of random draws; else None
    no_inputs  fits without any input that varies: they answer the most frequent grasp type of their training rows
    confusion  (K, K) counts of trials over all repeats, row: true, column: recognised, K as in Study.grasps; None but
               for compositions
    """

    rate: Rate
    frames: Rate | None
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
    """A row of a table: its short name, what it is, its switches, its cells, and the rate of all their trials (frames:
    of all their frames, None where each row is a trial).
    """

    name: str
    what: str
    switches: Spread
    cells: tuple[Cell, ...]
    rate: Rate
    frames: Rate | None


@dataclass(frozen=True, slots=True)
class RateTable:
    """A table in the paper's layout: a column a subject."""

    name: TableName
    protocol: ProtocolName
    columns: tuple[str, ...]
    rows: tuple[Row, ...]

    @property
    def title(self) -> str:
        """What the table shows, and what its rates are of."""
        return f"{_TITLES[self.name]}: {self.protocol} protocol, {self.rows[0].rate.what}"

    @property
    def note(self) -> str:
        """What a star means, in a sentence; "" where there is none."""
        starred = any(cell.no_inputs for row in self.rows for cell in row.cells)
        return "* In some folds no input varied: there, the most frequent grasp type is answered." if starred else ""


@dataclass(frozen=True, slots=True)
class Reader:
    """Reads rates off predictions.

    labels, trials  (n,) of each row       n_switches   the set's
    grasps          labels that occur      predictions  of each fit; blind: the fits that were
    of              what the rates are of, with the group (n,) that each row is left out with, None: its trial
    """

    labels: Labels
    trials: Rows
    grasps: tuple[int, ...]
    n_switches: int
    predictions: Predictions
    blind: frozenset[FoldFit]
    of: Of
    groups: NDArray[np.str_] | None

    def table(self, name: TableName, protocol: ProtocolName, plans: Sequence[RowPlan]) -> RateTable:
        """Return the table of these rows."""
        columns = tuple(cell.part.name for cell in plans[0].cells)
        rows = tuple(self._row(plan, confusing=name == "compositions") for plan in plans)
        return RateTable(name, protocol, columns, rows)

    def cell(self, plan: CellPlan, *, confusing: bool) -> Cell:
        """Return the cell of a plan, with its confusion matrix if `confusing`."""
        rate, frames = self._rates((plan,))
        counts = [sum(column < self.n_switches for column in fit.columns) for fit in plan.fits]
        blind = sum(fit in self.blind for fit in plan.fits)
        confusion = self._confusion(plan) if confusing else None
        return Cell(rate, frames, Spread.of(counts), blind, _draws(rate, len(plan.part.repeats)), confusion)

    def _row(self, plan: RowPlan, *, confusing: bool) -> Row:
        cells = tuple(self.cell(cell, confusing=confusing) for cell in plan.cells)
        spreads = [cell.switches for cell in cells]
        switches = Spread(min(s.least for s in spreads), fmean(s.mean for s in spreads), max(s.most for s in spreads))
        rate, frames = (cells[0].rate, cells[0].frames) if len(cells) == 1 else self._rates(plan.cells)
        return Row(plan.name, plan.what, switches, cells, rate, frames)

    def _rates(self, plans: Sequence[CellPlan]) -> tuple[Rate, Rate | None]:
        """Return the rates of trials and of frames of some cells together; their runs correspond."""
        rows, predicted = self._predicted(plans)
        groups = None if self.groups is None else self.groups[rows]
        repeats = len(plans[0].part.repeats)
        a_draw = repeats if len(predicted) > repeats else 1
        return rated(predicted, self.labels[rows], self.trials[rows], of=self.of, groups=groups, repeats_a_draw=a_draw)

    def _predicted(self, plans: Sequence[CellPlan]) -> tuple[Rows, Labels]:
        """Return the rows (n,) that some cells test, and the label (runs, n) that each run gives them."""
        rows = np.concatenate([fit.fold.test for plan in plans for fit in plan.runs[0]])
        predicted = np.zeros((len(plans[0].runs), len(self.labels)), dtype=np.intp)
        for plan in plans:
            for run, fits in enumerate(plan.runs):
                for fit in fits:
                    predicted[run, fit.fold.test] = self.predictions[fit]
        return rows, predicted[:, rows]

    def _confusion(self, plan: CellPlan) -> Confusion:
        rows, predicted = self._predicted((plan,))
        _, first, trial = np.unique(self.trials[rows], return_index=True, return_inverse=True)
        true = np.searchsorted(self.grasps, self.labels[rows[first]])
        counts = np.zeros((len(self.grasps), len(self.grasps)), dtype=np.intp)
        for found in decided(predicted, trial):
            np.add.at(counts, (true, np.searchsorted(self.grasps, found)), 1)
        return tuple(map(tuple, counts.tolist()))


def _draws(rate: Rate, repeats: int) -> Spread | None:
    """Return the spread of the draws' own rates, each over its `repeats`; None if there is one draw only."""
    if len(rate.correct) == repeats:
        return None
    draws = np.reshape(rate.correct, (-1, repeats)).mean(axis=1) / rate.total
    return Spread.of(draws.tolist())


TABLES: tuple[TableName, ...] = ("compositions", "generality", "pruning", "baselines")

# Those with a row that is trained on all switches at once.
_OF_ALL_SWITCHES: tuple[TableName, ...] = ("compositions", "pruning")


@dataclass(frozen=True, slots=True)
class Options:
    """What to evaluate, and how.

    subjects    whose rows to use; none given: everybody's
    scheme      what is kept whole in a fold: trials (stratified as in Weka), blocks of trial numbers, or, each left out
                in turn, subjects, objects or sessions
    folds       of `trial` and `block`
    repeats     of `trial`, with seeds seed, seed + 1, ...
    prune       S of the placements of the compositions, the generality and the baselines
    prune_list  each S of the table of pooled and pruned placements
    rivals      methods that ID3 is compared with in the baselines, besides random placements
    trainer     what makes every classifier, with its `settings`; rounds are LogitBoost's
    """

    subjects: tuple[str, ...] = ()
    scheme: Scheme = "trial"
    folds: int = 4
    repeats: int = 3
    rounds: int = 100
    prune: int = 0
    prune_list: tuple[int, ...] = (0, 13, 62)
    protocols: tuple[ProtocolName, ...] = ("paper", "nested")
    tables: tuple[TableName, ...] = TABLES
    seed: int = 1
    rivals: tuple[str, ...] = RIVALS
    trainer: str = "logitboost"
    settings: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class LeftOut:
    """A table that has no meaning for a set, and why."""

    name: TableName
    reason: str


@dataclass(frozen=True, slots=True)
class Study:
    """The result: what was asked of which set, the grasp types that occur, what to beware of, and the tables.

    left_out names the tables that were asked for but have no meaning here, with the reason.
    """

    fingerprint: str
    rows: int
    trials: int
    options: Options
    grasps: tuple[str, ...]
    warnings: tuple[str, ...]
    left_out: tuple[LeftOut, ...]
    tables: tuple[RateTable, ...]

    def __str__(self) -> str:
        """Return how many trials and frames there are, and how they were cut."""
        options, repeats = self.options, counted(self.options.repeats, "repeat")
        cut = {
            "trial": f"{options.folds} stratified folds of whole trials, {repeats} from seed {options.seed}",
            "subject": "one subject left out at a time (the column), all others trained on",
            "object": "one object left out at a time",
            "session": "one session left out at a time",
            "block": f"{options.folds} blocks of trials",
        }[options.scheme]
        grasps = counted(len(self.grasps), "grasp type")
        frames = f" of {self.rows:,} frames" if self.rows > self.trials else ""
        size = f"{counted(self.trials, 'trial')}{frames}, {grasps}"
        return f"{size}; {cut}; {options.rounds} rounds; accuracies in % with 95 % intervals"


def evaluate(
    grasp_set: GraspSet,
    options: Options | None = None,
    jobs: int = -1,
    progress: Progress | None = None,
    **changes: Any,
) -> Study:
    """Cross-validate: return the paper's tables that `options` ask for and the set has the inputs for.

    Parameters
    ----------
    grasp_set : GraspSet
        The recordings.
    options : Options, optional
        What to evaluate, and how.
    jobs : int
        Worker processes; -1: all cores. The result is the same for any number of them.
    progress : callable, optional
        Called with (done, total) after each classifier.
    **changes
        Single options, such as `folds=5`, instead of those in `options`.

    Returns
    -------
    Study
        The tables, of rates in 0..1 with 95 % intervals, and what to beware of.

    Raises
    ------
    EvaluationError
        If the set cannot be cut as asked.
    MemberError, TrainerError
        For a rival that is no method, or a trainer that is not there or takes no such setting.

    Examples
    --------
    >>> from thenar.compiler import GraspSet, evaluate
    >>> tables = {"tables": ("compositions",), "protocols": ("nested",)}
    >>> study = evaluate(GraspSet.load("set.grasps"), jobs=1, folds=2, repeats=1, rounds=2, **tables)
    >>> 0 <= study.tables[0].rows[0].rate.mean <= 1
    True
    """
    options = replace(options or Options(), **changes)
    for name in options.rivals:
        if not METHODS.named(name).by_number:
            raise EvaluationError(f"{name} takes S: a rival is a method that takes a number of switches")
    training = Training.of(changed(Manifested(rounds=options.rounds, trainer=options.trainer), options.settings))
    chosen = _of_subjects(grasp_set, options.subjects)
    parts = populations(chosen, options.scheme, options.folds, options.repeats, options.seed)
    reasons = {name: _why_not(name, chosen, parts, options.scheme) for name in options.tables}
    if any(reasons.get(name, "") is None for name in _OF_ALL_SWITCHES):
        _check_all_switches(chosen, parts)
    planner = Planner(
        parts,
        Samples.of(chosen, "switches"),
        len(chosen.joints),
        options.prune,
        options.prune_list,
        options.seed,
        options.rivals,
    )
    protocols = [protocol for protocol in PROTOCOLS if protocol.name in options.protocols]
    plans = {
        (name, each.name): planner.table(name, each)
        for name, reason in reasons.items()
        if reason is None
        for each in protocols
    }
    fits = [fit for rows in plans.values() for row in rows for cell in row.cells for fit in cell.fits]
    X = inputs(chosen)
    predictions = run_fits(X, chosen.labels, fits, training, jobs, progress)
    grasps = tuple(np.unique(chosen.labels).tolist())
    blind = frozenset(fit for fit in predictions if is_blind(X, fit))
    trials = chosen.trial_ids
    reader = Reader(
        chosen.labels,
        trials,
        grasps,
        len(chosen.element_names),
        predictions,
        blind,
        OF[options.scheme],
        groups_of(chosen, options.scheme),
    )
    return Study(
        fingerprint=grasp_set.fingerprint(),
        rows=len(chosen),
        trials=int(trials.max()) + 1,
        options=options,
        grasps=tuple(chosen.taxonomy.types[label] for label in grasps),
        warnings=concerns(chosen, parts, options.scheme, options.folds),
        left_out=tuple(LeftOut(name, reason) for name, reason in reasons.items() if reason is not None),
        tables=tuple(reader.table(*which, rows) for which, rows in plans.items()),
    )


def _of_subjects(grasp_set: GraspSet, subjects: tuple[str, ...]) -> GraspSet:
    if not len(grasp_set):
        raise EvaluationError("the set has no rows: nothing to evaluate")
    known = np.unique(grasp_set.subjects).tolist()
    unknown = [name for name in subjects if name not in known]
    if unknown:
        raise EvaluationError(f"no subject {unknown[0]!r} in the set; its subjects are {', '.join(known)}")
    chosen = grasp_set.rows(np.isin(grasp_set.subjects, subjects)) if subjects else grasp_set
    types = len(np.unique(chosen.labels))
    check_types(types, EvaluationError)
    check_memory(len(chosen), types, EvaluationError)
    return chosen


def _check_all_switches(grasp_set: GraspSet, parts: tuple[Population, ...]) -> None:
    """Raise EvaluationError where a training on all switches has no room in memory: before placements are chosen."""
    switches = grasp_set.switches
    varying = int(np.count_nonzero(switches.any(axis=0) & ~switches.all(axis=0))) + len(grasp_set.taxel_columns)
    for part in parts:
        rows = max((len(fold.train) for fold in part.folds), default=0)
        check_memory(rows, len(part.grasps), EvaluationError, varying)


def _why_not(name: TableName, grasp_set: GraspSet, parts: tuple[Population, ...], scheme: Scheme) -> str | None:
    """Return why a table has no meaning for the set and the cut, or None."""
    if name != "compositions" and not grasp_set.element_names:
        return "a placement needs switches, and the set has none"
    if name == "generality" and len(parts) < 2:
        return "another's placement needs a second subject"
    if name == "generality" and scheme == "subject":
        return "when a subject is left out, the placement always is others'"
    return None
