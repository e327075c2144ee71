"""An evaluation: the paper's tables for the user's recordings, with each distinct fit run once."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np

from thenar.runtime.recipe import PAPERS_TRAINER, Recipe, changed

from ..placement.constraints import Limits
from ..placement.methods.base import METHODS, PAPERS, by_sensors, check_placement
from ..placement.ports import PortCosts
from ..recordings.graspset import GraspSet
from ..recordings.summary import check_trials
from ..samples import Samples, check_types
from ..text import counted
from ..workers import check_memory
from .choosing import InputChoices
from .folds import (
    OF,
    PROTOCOLS,
    EvaluationError,
    Population,
    ProtocolName,
    Scheme,
    concerns,
    groups_of,
    populations_of,
)
from .plan import (
    BASELINES,
    FoldFit,
    Labels,
    Planner,
    Progress,
    TableName,
    candidates_of,
    run_fits,
)
from .rates import RecipeWords
from .tables import RateReader, RateTable

# Without the table of trainers, which takes longer than all of these.
TABLES: tuple[TableName, ...] = ("compositions", "generality", "pruning", "baselines")

# Tables with a row that trains on all switches at once.
_OF_ALL_SWITCHES: tuple[TableName, ...] = ("compositions", "pruning")
_FEWEST_FOLDS = 2
PAPERS_RECIPE = Recipe(trainer=PAPERS_TRAINER)


@dataclass(frozen=True, slots=True)
class StudyDesign:
    """What to evaluate, and how.

    recipe      of every classifier: its placement, which the tables vary, its trainer, and folds and seed. In the table
                of trainers, the settings that are not given are chosen from the training rows
    subjects    whose rows to use; empty: everybody's
    scheme      what is kept together in a fold: trials (stratified as in Weka), or subjects, objects or sessions,
                each left out in turn
    repeats     for `trial`, with seeds seed, seed + 1, ...
    prune_list  each S of the table of pooled and pruned placements
    baselines   methods to compare with the recipe's, in addition to random placements
    """

    recipe: Recipe = PAPERS_RECIPE
    subjects: tuple[str, ...] = ()
    scheme: Scheme = "trial"
    repeats: int = 1
    prune_list: tuple[int, ...] = (0, 13, 62)
    protocols: tuple[ProtocolName, ...] = ("nested",)
    tables: tuple[TableName, ...] = TABLES
    baselines: tuple[str, ...] = BASELINES

    def __post_init__(self) -> None:
        if self.recipe.folds < _FEWEST_FOLDS:
            raise EvaluationError(f"``folds`` {self.recipe.folds}: an evaluation needs {_FEWEST_FOLDS} or more")
        check_placement(self.recipe)
        for name in self.baselines:
            if not METHODS.named(name).by_number:
                raise EvaluationError(f"{name} takes S: baselines must be methods that take a number of switches")

    def changed(self, **changes: Any) -> Self:
        """Return a design with other values, by name: fields, choices of the recipe, or settings of its trainer."""
        names = {choice.name for choice in fields(self)}
        recipe = changed(self.recipe, {name: value for name, value in changes.items() if name not in names})
        return replace(self, **{"recipe": recipe, **{name: changes[name] for name in changes if name in names}})


@dataclass(frozen=True, slots=True)
class LeftOut:
    """A table that has no meaning for a set, and why."""

    name: TableName
    reason: str


@dataclass(frozen=True, slots=True)
class Study:
    """The result: the design and the set, the grasp types that occur, warnings, and the tables.

    left_out names requested tables that have no meaning here, with the reason. rests is the number of trials in which
    nothing is held; they are left out.
    """

    fingerprint: str
    rows: int
    trials: int
    options: StudyDesign
    grasps: tuple[str, ...]
    warnings: tuple[str, ...]
    left_out: tuple[LeftOut, ...]
    tables: tuple[RateTable, ...]
    rests: int = 0

    def __str__(self) -> str:
        """Return the numbers of trials and frames, and the scheme of the folds."""
        design, recipe = self.options, self.options.recipe
        repeats = counted(design.repeats, "repeat")
        cut = {
            "trial": f"{recipe.folds} stratified folds of whole trials, {repeats} from seed {recipe.seed}",
            "subject": "one subject left out at a time (the column), all others trained on",
            "object": "one object left out at a time",
            "session": "one session left out at a time",
        }[design.scheme]
        grasps = counted(len(self.grasps), "grasp type")
        frames = f" of {self.rows:,} frames" if self.rows > self.trials else ""
        rests = f"; {counted(self.rests, 'rest')} left out" if self.rests else ""
        size = f"{counted(self.trials, 'trial')}{frames}, {grasps}{rests}"
        return f"{size}; {cut}; accuracies in % with 95 % intervals"


def evaluate(
    grasp_set: GraspSet,
    design: StudyDesign | None = None,
    jobs: int = -1,
    progress: Progress | None = None,
    *,
    ports: PortCosts | None = None,
    limits: Limits | None = None,
    **changes: Any,
) -> Study:
    """Cross-validate: return the paper's tables that `design` requests and the set has inputs for.

    Parameters
    ----------
    grasp_set : GraspSet
        The recordings. Rows in which nothing is held are left out.
    design : StudyDesign, optional
        What to evaluate, and how.
    jobs : int
        Worker processes; -1: all cores. The result does not depend on their number.
    progress : callable, optional
        Called with (done, total) after each classifier.
    ports, limits : PortCosts, Limits, optional
        Costs of reading the glove, and constraints on every placement, as for `place`.
    **changes
        Single fields of the design, choices of its recipe such as `folds=5`, or settings of its trainer.

    Returns
    -------
    Study
        The tables, with rates in 0..1 and their 95 % intervals, and warnings.

    Raises
    ------
    EvaluationError
        If the set cannot be split as requested, or its rows look like frames of fewer trials than it has.
    SettingError, TrainingError
        For an unknown baseline, or an unknown trainer or setting.

    Examples
    --------
    >>> from thenar.compiler import GraspSet, evaluate
    >>> tables = {"tables": ("compositions",), "protocols": ("nested",)}
    >>> study = evaluate(GraspSet.load("set.grasps"), jobs=1, folds=2, repeats=1, rounds=2, **tables)
    >>> 0 <= study.tables[0].rows[0].rate.mean <= 1
    True
    """
    run = StudyRun(grasp_set, (design or StudyDesign()).changed(**changes), ports, limits)
    return replace(run.study, tables=run.tables(run.names, jobs, progress))


class StudyRun:
    """An evaluation some tables at a time; the parameters are those of `evaluate`.

    Attributes
    ----------
    names : tuple
        The name and protocol of each table, in their order.
    study : Study
        The result without tables.
    """

    def __init__(
        self, grasp_set: GraspSet, design: StudyDesign, ports: PortCosts | None = None, limits: Limits | None = None
    ) -> None:
        recipe, scheme = design.recipe, design.scheme
        chosen = _of_subjects(grasp_set.without_none(), design.subjects)
        populations = populations_of(chosen, scheme, recipe.folds, design.repeats, recipe.seed)
        reasons = {name: _why_not(name, chosen, populations, design) for name in design.tables}
        if any(reasons.get(name, "") is None for name in _OF_ALL_SWITCHES):
            # Training on all switches must fit in memory: say so before placements are chosen.
            varying = chosen.switches.any(axis=0) & ~chosen.switches.all(axis=0)
            wide = int(varying.sum()) + len(chosen.taxel_columns)
            for population in populations:
                rows = max((len(fold.train) for fold in population.folds), default=0)
                check_memory(rows, len(population.grasps), EvaluationError, wide)
        self.names: tuple[tuple[TableName, ProtocolName], ...] = tuple(
            (name, protocol)
            for name, reason in reasons.items()
            if reason is None
            for protocol in PROTOCOLS
            if protocol in design.protocols and (protocol == "nested" or name != "trainers")
        )
        samples, self._groups = Samples.of(chosen), groups_of(chosen, scheme)
        choices = InputChoices(samples, ports, limits)
        self._planner = Planner(populations, choices, recipe, design.prune_list, design.baselines)
        self._predicted: dict[FoldFit, Labels] = {}
        empty = grasp_set.is_none & np.isin(grasp_set.subjects, np.unique(chosen.subjects))
        self.study = Study(
            fingerprint=grasp_set.fingerprint(),
            rows=len(chosen),
            trials=int(samples.trials.max()) + 1,
            options=design,
            grasps=samples.grasps,
            warnings=concerns(chosen, populations, scheme, recipe.folds),
            left_out=tuple(LeftOut(name, reason) for name, reason in reasons.items() if reason is not None),
            tables=(),
            rests=len(np.unique(grasp_set.trial_ids[empty])),
        )

    def tables(
        self, names: Sequence[tuple[TableName, ProtocolName]], jobs: int = -1, progress: Progress | None = None
    ) -> tuple[RateTable, ...]:
        """Return some of the tables; fits that were run for others are not run again."""
        design, samples = self.study.options, self._planner.samples
        plans = {name: self._planner.table(*name) for name in names}
        fits = (fit for rows in plans.values() for row in rows for cell in row.cells for fit in cell.fits)
        todo, candidates = (fit for fit in fits if fit not in self._predicted), candidates_of(design.recipe)
        self._predicted |= run_fits(samples, todo, candidates, self._groups, jobs=jobs, progress=progress)
        reader = RateReader(samples, self._predicted, OF[design.scheme], self._groups)
        return tuple(reader.table(*name, rows, _recipe_of(name[0], design.recipe)) for name, rows in plans.items())


def _recipe_of(name: TableName, recipe: Recipe) -> RecipeWords:
    """Return the words for the recipe of a table."""
    same = RecipeWords.of(recipe)
    methods: dict[TableName, str] = {
        "pruning": f"{PAPERS}, S of the row, all subjects pooled",
        "baselines": f"that of the row, as many elements as {same.method}",
    }
    chosen = "that of the row, its settings chosen from the training rows"
    return RecipeWords(methods.get(name, same.method), chosen if name == "trainers" else same.trainer)


def _of_subjects(grasp_set: GraspSet, subjects: tuple[str, ...]) -> GraspSet:
    if not len(grasp_set):
        raise EvaluationError("the set has no rows: nothing to evaluate")
    known = np.unique(grasp_set.subjects).tolist()
    unknown = [name for name in subjects if name not in known]
    if unknown:
        raise EvaluationError(f"no subject {unknown[0]!r} in the set; its subjects are {', '.join(known)}")
    chosen = grasp_set.rows(np.isin(grasp_set.subjects, subjects)) if subjects else grasp_set
    check_trials(chosen, EvaluationError)
    types = len(np.unique(chosen.labels))
    check_types(types, EvaluationError)
    check_memory(len(chosen), types, EvaluationError)
    return chosen


def _why_not(
    name: TableName, grasp_set: GraspSet, populations: tuple[Population, ...], design: StudyDesign
) -> str | None:
    """Return why a table has no meaning for the set and the design, or None."""
    if name == "trainers":
        return None if "nested" in design.protocols else "trainers are compared under the nested protocol only"
    if name != "compositions" and not grasp_set.element_names:
        return "a placement needs switches, and the set has none"
    if name == "generality" and len(populations) < 2:
        return "another's placement needs a second subject"
    if name == "pruning" and (design.recipe.placement != PAPERS or by_sensors(design.recipe)):
        return f"S prunes the tree of {PAPERS}, and the recipe has another method"
    if name == "generality" and design.scheme == "subject":
        return "when a subject is left out, the placement is always that of others"
    return None
