"""An evaluation: the paper's tables for the user's recordings, with each distinct fit run once; learning curves; and a
permutation test.
"""

from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any, Self

import numpy as np

from thenar.runtime.manifest import Of, Unit
from thenar.runtime.recipe import PAPERS_TRAINER, Recipe, changed

from ..pictures import painting
from ..placement.constraints import Limits
from ..placement.methods.base import METHODS, PAPERS
from ..placement.ports import PortCosts
from ..recordings.graspset import GraspSet
from ..recordings.summary import check_trials
from ..samples import Samples, check_types
from ..text import counted
from ..workers import check_memory, in_workers
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
from .learning import Learning, plan_learning
from .plan import (
    BASELINES,
    Planner,
    Progress,
    TableName,
    candidates_of,
    predictions,
    run_fits,
)
from .rates import RecipeWords
from .tables import RateReader, RateTable, draw_confusions

# Without the table of trainers, which takes longer than all of these.
TABLES: tuple[TableName, ...] = ("compositions", "generality", "pruning", "baselines")
_NESTED: tuple[TableName, ...] = ("trainers", "joints")

# Tables with a row that trains on all switches at once.
_OF_ALL_SWITCHES: tuple[TableName, ...] = ("compositions", "pruning")
_FEWEST_FOLDS = 2
PAPERS_RECIPE = Recipe(trainer=PAPERS_TRAINER)
LEARNING_NAME = "learning-curve.svg"


@dataclass(frozen=True, slots=True)
class StudyDesign:
    """What to evaluate, and how.

    recipe      of every classifier: its placement, which the tables vary, its trainer, and folds and seed. In the table
                of trainers and the learning curve, the settings that are not given are chosen from the training rows
    subjects    whose rows to use; empty: everybody's
    scheme      what is kept together in a fold: trials (stratified as in Weka), blocks of trial numbers, or subjects,
                objects or sessions, each left out in turn
    repeats     for `trial`, with seeds seed, seed + 1, ...
    prune_list  each S of the table of pooled and pruned placements
    baselines   methods to compare with the recipe's, in addition to random placements
    learning    whether to compute learning curves
    permute     number of evaluations with shuffled labels, for the chance level; 0: none
    """

    recipe: Recipe = PAPERS_RECIPE
    subjects: tuple[str, ...] = ()
    scheme: Scheme = "trial"
    repeats: int = 1
    prune_list: tuple[int, ...] = (0, 13, 62)
    protocols: tuple[ProtocolName, ...] = ("nested",)
    tables: tuple[TableName, ...] = TABLES
    baselines: tuple[str, ...] = BASELINES
    permute: int = 0
    learning: bool = False

    def __post_init__(self) -> None:
        if self.recipe.folds < _FEWEST_FOLDS:
            raise EvaluationError(f"``folds`` {self.recipe.folds}: an evaluation needs {_FEWEST_FOLDS} or more")
        METHODS.named(self.recipe.placement).check_given(self.recipe.keep, self.recipe.prune)
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
class Permuted:
    """The accuracy of one composition under the nested protocol, one repeat, compared with shuffled labels.

    Labels are shuffled among the trials of each subject, keeping frames of a trial together; then folds are cut,
    placements chosen and classifiers trained as with the true labels.

    composition   its name and inputs             of, unit  what the accuracy is of
    rate          with the true labels            chance    mean accuracy of the permutations
    permutations  their number, m                 highest   their highest accuracy
    p             (b + 1) / (m + 1), where b permutations reach the accuracy: the probability of it by chance
    """

    composition: str
    recipe: RecipeWords
    of: Of
    unit: Unit
    rate: float
    permutations: int
    chance: float
    highest: float
    p: float

    def __str__(self) -> str:
        """Return accuracy, chance level and p-value in a sentence."""
        return (
            f"Permutation test of {self.composition}, {self.of}, {self.unit}, nested ({self.recipe}): "
            f"{100 * self.rate:.1f} %; chance "
            f"{100 * self.chance:.1f} % (mean of {self.permutations} shuffles of labels within subjects, highest "
            f"{100 * self.highest:.1f} %); p = {self.p:.2g}"
        )


@dataclass(frozen=True, slots=True)
class Study:
    """The result: the design and the set, the grasp types that occur, warnings, and the tables.

    left_out names requested tables that have no meaning here, with the reason; permuted is the permutation test,
    learning the learning curves; each is None if not requested. rests is the number of trials in which nothing is held;
    they are left out.
    """

    fingerprint: str
    rows: int
    trials: int
    options: StudyDesign
    grasps: tuple[str, ...]
    warnings: tuple[str, ...]
    left_out: tuple[LeftOut, ...]
    tables: tuple[RateTable, ...]
    permuted: Permuted | None = None
    learning: Learning | None = None
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
            "block": f"{recipe.folds} blocks of trials",
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
    design = (design or StudyDesign()).changed(**changes)
    recipe, scheme = design.recipe, design.scheme
    chosen = _of_subjects(grasp_set.without_none(), design.subjects)
    populations = populations_of(chosen, scheme, recipe.folds, design.repeats, recipe.seed)
    reasons = {name: _why_not(name, chosen, populations, design) for name in design.tables}
    if any(reasons.get(name, "") is None for name in _OF_ALL_SWITCHES):
        _check_all_switches(chosen, populations)
    samples = Samples.of(chosen)
    planner = Planner(populations, InputChoices(samples, ports, limits), recipe, design.prune_list, design.baselines)
    plans = {
        (name, protocol): planner.table(name, protocol)
        for name, reason in reasons.items()
        if reason is None
        for protocol in PROTOCOLS
        if protocol in design.protocols and (protocol == "nested" or name not in _NESTED)
    }
    curves = plan_learning(planner, chosen.subjects, scheme, design.repeats) if design.learning else None
    cells = [cell for rows in plans.values() for row in rows for cell in row.cells]
    cells += [cell for row in curves.cells.values() for cell in row] if curves else []
    fits = dict.fromkeys(fit for cell in cells for fit in cell.fits)

    def report(before: int, done: int, _: int) -> None:
        if progress is not None:
            progress(before + done, len(fits) + design.permute)

    groups, candidates = groups_of(chosen, scheme), candidates_of(recipe)
    predicted = run_fits(samples, fits, candidates, groups, jobs=jobs, progress=partial(report, 0))
    test, learning = None, None
    if design.permute:
        words = _recipe_of("compositions", recipe)
        test = _permuted(chosen, planner, scheme, words, design.permute, jobs, partial(report, len(fits)))
    reader = RateReader(samples, predicted, OF[scheme], groups)
    if curves is not None:
        learning = curves.read(reader, recipe.seed, _recipe_of("trainers", recipe))
    empty = grasp_set.is_none & np.isin(grasp_set.subjects, np.unique(chosen.subjects))
    return Study(
        fingerprint=grasp_set.fingerprint(),
        rows=len(chosen),
        trials=int(samples.trials.max()) + 1,
        options=design,
        grasps=samples.grasps,
        warnings=concerns(chosen, populations, scheme, recipe.folds),
        left_out=tuple(LeftOut(name, reason) for name, reason in reasons.items() if reason is not None),
        tables=tuple(
            reader.table(name, protocol, rows, _recipe_of(name, recipe)) for (name, protocol), rows in plans.items()
        ),
        permuted=test,
        learning=learning,
        rests=len(np.unique(grasp_set.trial_ids[empty])),
    )


def draw(study: Study, folder: Path) -> list[Path]:
    """Write a picture for each composition and protocol, subjects side by side, and one of learning curves, if present.

    Return the files: `confusion-PROTOCOL-COMPOSITION.png` and LEARNING_NAME in `folder`, which is created if necessary.
    Raises OSError from the system.
    """
    folder.mkdir(parents=True, exist_ok=True)
    compositions = [table for table in study.tables if table.name == "compositions"]
    with painting(font_size=10):
        curves = [] if study.learning is None else [study.learning.draw(folder / LEARNING_NAME)]
        return curves + [
            draw_confusions(study.grasps, table, row, folder) for table in compositions for row in table.rows
        ]


def _permuted(
    grasp_set: GraspSet,
    planner: Planner,
    scheme: Scheme,
    words: RecipeWords,
    m: int,
    jobs: int,
    progress: Progress,
) -> Permuted:
    """Return the test of an evaluation, of m > 0 permutations, with selected switches and joints as far as the set has
    them; `planner` is that of the true labels.
    """
    # Without what it chose for the true labels: it goes to the workers.
    fresh = replace(planner, choices=replace(planner.choices))
    tasks = [(grasp_set, fresh, scheme, number) for number in range(m + 1)]
    correct, total = _recognised(tasks[0])
    shuffled: list[int] = []
    for recognised, _ in in_workers(_recognised, tasks[1:], jobs):
        shuffled += [recognised]
        progress(len(shuffled), m)
    return Permuted(
        composition=str(planner.kinds[0]),
        recipe=words,
        of=OF[scheme],
        unit="trials",
        rate=correct / total,
        permutations=m,
        chance=sum(shuffled) / m / total,
        highest=max(shuffled) / total,
        p=(sum(count >= correct for count in shuffled) + 1) / (m + 1),
    )


def _recognised(task: tuple[GraspSet, Planner, Scheme, int]) -> tuple[int, int]:
    """Return the number of trials that a permutation (0: the true labels) predicts correctly, and the total."""
    grasp_set, planner, scheme, number = task
    recipe = planner.recipe
    if number:
        grasp_set = shuffled_labels(grasp_set, (recipe.seed, number))
    samples, populations = Samples.of(grasp_set), planner.populations
    if scheme == "trial":
        populations = populations_of(grasp_set, scheme, recipe.folds, 1, recipe.seed)
    planner = replace(planner, populations=populations, choices=replace(planner.choices, samples=samples))
    plans = [
        planner.cell(population, planner.kinds[0], partial(planner.placement, "nested")) for population in populations
    ]
    plans = [replace(plan, runs=plan.runs[:1]) for plan in plans]
    candidates = candidates_of(recipe)
    predicted = {fit: predictions(samples, fit, candidates) for plan in plans for fit in plan.fits}
    rate, _ = RateReader(samples, predicted, OF[scheme], groups_of(grasp_set, scheme)).rates(plans)
    return rate.correct[0], rate.total


def shuffled_labels(grasp_set: GraspSet, seed: tuple[int, ...]) -> GraspSet:
    """Return the set with its grasp types shuffled among the trials of each subject; trials stay whole."""
    random = np.random.default_rng(seed)
    trial = grasp_set.trial_ids
    _, first = np.unique(trial, return_index=True)
    subjects, grasps = grasp_set.subjects[first], grasp_set.grasps[first]
    for subject in np.unique(subjects):
        rows = np.flatnonzero(subjects == subject)
        grasps[rows] = grasps[random.permutation(rows)]
    # The trial number keeps two trials apart that get the same label.
    return replace(grasp_set, grasps=grasps[trial], trials=trial)


def _recipe_of(name: TableName, recipe: Recipe) -> RecipeWords:
    """Return the words for the recipe of a table."""
    same = RecipeWords.of(recipe)
    methods: dict[TableName, str] = {
        "pruning": f"{PAPERS}, S of the row, all subjects pooled",
        "baselines": f"that of the row, as many elements as {same.method}",
        "joints": "none, joints alone",
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


def _check_all_switches(grasp_set: GraspSet, populations: tuple[Population, ...]) -> None:
    """Raise EvaluationError if training on all switches does not fit in memory, before placements are chosen."""
    varying = grasp_set.switches.any(axis=0) & ~grasp_set.switches.all(axis=0)
    for population in populations:
        rows = max((len(fold.train) for fold in population.folds), default=0)
        check_memory(rows, len(population.grasps), EvaluationError, int(varying.sum()) + len(grasp_set.taxel_columns))


def _why_not(
    name: TableName, grasp_set: GraspSet, populations: tuple[Population, ...], design: StudyDesign
) -> str | None:
    """Return why a table has no meaning for the set and the design, or None."""
    if name == "joints" and not grasp_set.joints:
        return "the set has no joints"
    if name in _NESTED:
        return None if "nested" in design.protocols else f"{name} are compared under the nested protocol only"
    if name != "compositions" and not grasp_set.element_names:
        return "a placement needs switches, and the set has none"
    if name == "generality" and len(populations) < 2:
        return "another's placement needs a second subject"
    if name == "pruning" and design.recipe.placement != PAPERS:
        return f"S prunes the tree of {PAPERS}, and the recipe has another method"
    if name == "generality" and design.scheme == "subject":
        return "when a subject is left out, the placement is always that of others"
    return None
