"""Plan the fits for each table (inputs, placement, folds), and run each distinct fit once."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.model.tables import winners
from thenar.runtime.recipe import AUTO, Recipe, changed

from ..placement.elements import Elements
from ..placement.methods.base import METHODS, PAPERS, by_sensors
from ..placement.methods.baselines import random_placement
from ..placement.placement import InputSelection
from ..placement.sensors import SENSORS, SENSORS_HELP
from ..samples import Columns, Samples
from ..trainers.base import TRAINERS, Training
from ..workers import MOST_JOBS, in_workers
from .choosing import InputChoices, choose_training
from .folds import Fold, Population, ProtocolName, Rows, may_choose, may_choose_pooled

Labels = NDArray[np.intp]
Progress = Callable[[int, int], None]
# For each learner of a fit, the trainings among which each fit chooses.
Candidates = Mapping[str, tuple[Training, ...]]
# Rows times types of fits that are trained together: 256 KiB of doubles fit a processor's cache.
_CELLS_TOGETHER = 1 << 15
REFERENCE = "logitboost"  # the trainer with which the others are compared


def candidates_of(recipe: Recipe) -> Candidates:
    """Return the candidates of each learner: requested settings apply to the trainers that have them."""
    trainers = dict.fromkeys([*TRAINERS, recipe.trainer])
    recipes = {name: recipe if name == recipe.trainer else Recipe(trainer=name) for name in trainers}
    return {"": (Training.of(recipe),), **{name: Training.candidates(recipes[name]) for name in trainers}}


@dataclass(frozen=True, slots=True)
class FoldFit:
    """Train on a fold's training rows with these elements, joints, and classes `grasps` (ascending labels); then test.

    `learner` is a trainer or AUTO, whose settings are chosen on the training rows; "": the trainer and settings of the
    recipe. Two fits are equal if they have the same `Fold` object, inputs and learner.
    """

    fold: Fold
    elements: Elements
    joints: Columns
    grasps: tuple[int, ...]
    learner: str = ""

    def read(self, samples: Samples, rows: Rows) -> Samples:
        """Return some rows of a set with only these inputs."""
        return InputSelection.of(self.elements, self.joints).read(samples.rows(rows))

    def learnt(self, samples: Samples) -> Samples:
        """Return the training rows with only these inputs, and labels that number `grasps`."""
        read = self.read(samples, self.fold.train)
        labels = np.searchsorted(self.grasps, read.labels)
        return replace(read, labels=labels, grasps=tuple(map(str, self.grasps)))

    def is_blind(self, samples: Samples) -> bool:
        """Return whether none of the inputs varies among the training rows."""
        return not self.read(samples, self.fold.train).varies


def predictions(
    samples: Samples, fits: Sequence[FoldFit], candidates: Candidates, groups: NDArray[np.str_] | None = None
) -> list[Labels]:
    """Return the labels predicted for the test rows of each fold, by the best of the learner's candidates.

    A blind fit predicts the most frequent label of the training rows, which is the accuracy to beat. `groups` (n,) are
    what each row is left out with, None: its trial.
    """
    (usual,) = candidates[""]
    learning = [fit.learnt(samples) for fit in fits]
    pairs = [*zip(fits, learning, strict=True)]
    drafts = iter(usual.drafts([learnt for fit, learnt in pairs if learnt.varies and not fit.learner]))
    labels = []
    for fit, learnt in pairs:
        grasps, test = np.array(fit.grasps, dtype=np.intp), fit.read(samples, fit.fold.test)
        if not learnt.varies:
            labels.append(np.full(len(fit.fold.test), grasps[learnt.most_frequent]))
            continue
        if fit.learner:
            by = None if groups is None else groups[fit.fold.train]
            fitting = choose_training(learnt, candidates[fit.learner], groups=by)
            model = Training.chosen(fitting, masked=usual.masked).draft(learnt)
        else:
            model = next(drafts)
        labels.append(grasps[winners(model.scores(test.switches, test.codes))])
    return labels


def run_fits(
    samples: Samples,
    fits: Iterable[FoldFit],
    candidates: Candidates,
    groups: NDArray[np.str_] | None = None,
    *,
    jobs: int = -1,
    progress: Progress | None = None,
) -> dict[FoldFit, Labels]:
    """Return the predictions of every fit. Equal fits are run once; `progress(done, total)` is called after each.

    jobs  worker processes, as in joblib: -1 for all cores, 1 for this process only. A worker runs one thread. Sums in
          boosting are exact, so the result does not depend on the number of workers.
    """
    todo = list(dict.fromkeys(fits))
    results: dict[FoldFit, Labels] = {}
    cells = max((len(fit.fold.train) * len(fit.grasps) for fit in todo), default=1)
    together = max(1, min(_CELLS_TOGETHER // cells, len(todo) // MOST_JOBS))
    batches = [todo[start : start + together] for start in range(0, len(todo), together)]
    tasks = ((number, (samples, batch, candidates, groups)) for number, batch in enumerate(batches))
    for number, batch in in_workers(_numbered, tasks, jobs):
        for fit, labels in zip(batches[number], batch, strict=True):
            results[fit] = labels
            if progress is not None:
                progress(len(results), len(todo))
    return results


def _numbered(task: tuple[int, tuple[Any, ...]]) -> tuple[int, list[Labels]]:
    return task[0], predictions(*task[1])


@dataclass(frozen=True, slots=True)
class Composition:
    """The inputs of a classifier: the joints (Angle), the placement's switches (Sel-Co), the others (NoSel-Co)."""

    name: str
    what: str
    angle: bool
    selected: bool
    others: bool

    def __str__(self) -> str:
        """Return "II Angle + Sel-Co"."""
        return f"{self.name} {self.what}"

    def elements(self, placement: Elements, known: Elements) -> Elements:
        """Return the elements that it uses, ascending, given the selected and the available ones."""
        kept = set(placement)
        others = [element for element in known if element not in kept]
        return tuple(sorted([*kept] * self.selected + others * self.others))


COMPOSITIONS = (
    Composition("I", "Angle + All-Co", angle=True, selected=True, others=True),
    Composition("II", "Angle + Sel-Co", angle=True, selected=True, others=False),
    Composition("III", "Angle + NoSel-Co", angle=True, selected=False, others=True),
    Composition("IV", "Angle", angle=True, selected=False, others=False),
    Composition("V", "All-Co", angle=False, selected=True, others=True),
    Composition("VI", "Sel-Co", angle=False, selected=True, others=False),
    Composition("VII", "NoSel-Co", angle=False, selected=False, others=True),
)
ANGLE_SELECTED, ANGLE, ALL_SWITCHES, SELECTED = COMPOSITIONS[1], COMPOSITIONS[3], COMPOSITIONS[4], COMPOSITIONS[5]


def available(n_switches: int, n_joints: int) -> tuple[Composition, ...]:
    """Return the compositions that a set has inputs for: without switches only IV, without joints V, VI and VII."""
    return tuple(c for c in COMPOSITIONS if (n_joints or not c.angle) and (n_switches or not (c.selected or c.others)))


TableName = Literal["compositions", "generality", "pruning", "baselines", "trainers"]
Select = Callable[[Population, Fold], Elements]

BASELINES = ("cmim", "mutual-information")
DRAWS = 5  # random placements to compare with


@dataclass(frozen=True, slots=True)
class CellPlan:
    """The fits of one cell: `runs` of folds, one per repeat; a cell of random draws has all repeats of each draw."""

    population: Population
    runs: tuple[tuple[FoldFit, ...], ...]

    @property
    def fits(self) -> list[FoldFit]:
        """The fits of all runs."""
        return [fit for run in self.runs for fit in run]


@dataclass(frozen=True, slots=True)
class RowPlan:
    """A row of a table: its short name, its description, and its cells, one per population."""

    name: str
    what: str
    cells: tuple[CellPlan, ...]


@dataclass(frozen=True, slots=True)
class Planner:
    """Plans the tables for populations of one set.

    choices  of elements and joints, from training rows; recipe: how they are chosen, and how many joints classifiers
             get, given the switches; baselines: methods to compare with.
    """

    populations: tuple[Population, ...]
    choices: InputChoices
    recipe: Recipe
    prune_list: tuple[int, ...] = ()
    baselines: tuple[str, ...] = BASELINES

    @property
    def samples(self) -> Samples:
        """All rows."""
        return self.choices.samples

    def table(self, name: TableName, protocol: ProtocolName) -> list[RowPlan]:
        """Return the rows of a table under a protocol."""
        rows: dict[TableName, Callable[[ProtocolName], list[RowPlan]]] = {
            "generality": self._generality,
            "pruning": self._pruning,
            "baselines": self._baselines,
            "trainers": self._trainers,
        }
        if name in rows:
            return rows[name](protocol)
        kinds = available(self._n_switches, self.choices.n_joints)
        return [self._row(kind.name, kind.what, kind, partial(self.placement, protocol)) for kind in kinds]

    def _generality(self, protocol: ProtocolName) -> list[RowPlan]:
        def chosen_by(giver: Population, population: Population, fold: Fold) -> Elements:
            # Another subject's placement has never seen this subject's rows: both protocols allow it.
            return self.chosen(may_choose(protocol, population, fold) if population is giver else giver.rows)

        return [
            self._row(giver.name, f"placement of subject {giver.name}", SELECTED, partial(chosen_by, giver))
            for giver in self.populations
        ]

    def _pruning(self, protocol: ProtocolName) -> list[RowPlan]:
        everyone = np.unique(np.concatenate([population.rows for population in self.populations]))

        def pooled(least: int, population: Population, fold: Fold) -> Elements:
            return self.chosen(may_choose_pooled(protocol, everyone, fold), prune=least)

        # One tree of some rows serves every S.
        recipes = [changed(self.recipe, {"prune": least}) for least in self.prune_list]
        folds = [fold for population in self.populations for fold in population.folds]
        several = {rows.tobytes(): rows for rows in (may_choose_pooled(protocol, everyone, fold) for fold in folds)}
        self.choices.choose(recipes, list(several.values()))
        everything = self._row("all", "all switches", ALL_SWITCHES, lambda population, fold: ())
        pruned = [self._row(str(s), f"S = {s}", SELECTED, partial(pooled, s)) for s in self.prune_list]
        return [everything, *pruned]

    def _baselines(self, protocol: ProtocolName) -> list[RowPlan]:
        def baseline(name: str, population: Population, fold: Fold) -> Elements:
            number = len(self.placement(protocol, population, fold))
            other = {"placement": name, "keep": number or None, "prune": 0, "sensors": None, "price": None}
            return self.chosen(may_choose(protocol, population, fold), **other)

        def drawn(draw: int, population: Population, fold: Fold) -> Elements:
            elements, number = self.elements(fold.train), len(self.placement(protocol, population, fold))
            return tuple(elements[place] for place in random_placement(len(elements), number, self.recipe.seed + draw))

        def random(population: Population) -> CellPlan:
            cells = (self.cell(population, SELECTED, partial(drawn, draw)) for draw in range(DRAWS))
            return CellPlan(population, tuple(run for cell in cells for run in cell.runs))

        recipe = METHODS.named(self.recipe.placement)
        title, what = recipe.title, "the paper's placement" if recipe.name == PAPERS else recipe.help
        if by_sensors(self.recipe):
            title, what = SENSORS, SENSORS_HELP
        baselines = [METHODS.named(name) for name in self.baselines if name != title]
        return [
            self._row(title, what, SELECTED, partial(self.placement, protocol)),
            *(self._row(other.title, other.help, SELECTED, partial(baseline, other.name)) for other in baselines),
            RowPlan("random", f"mean of {DRAWS} draws", tuple(map(random, self.populations))),
        ]

    def _trainers(self, protocol: ProtocolName) -> list[RowPlan]:
        chosen = partial(self.placement, protocol)
        # Choosing settings takes as long as many fits: a single repeat is run.
        once = replace(
            self,
            populations=tuple(replace(population, repeats=population.repeats[:1]) for population in self.populations),
        )
        return [once._row(name, kind.what, kind, chosen, name) for kind in self.kinds for name in TRAINERS]

    @property
    def kinds(self) -> tuple[Composition, ...]:
        """The inputs for comparing trainers: selected switches and joints, as far as available, and each alone."""
        there = available(self._n_switches, self.choices.n_joints)
        return tuple(kind for kind in (ANGLE_SELECTED, ANGLE, SELECTED) if kind in there)

    @property
    def _n_switches(self) -> int:
        return self.samples.n_switches + int(self.samples.taxels.shape[1])

    def placement(self, protocol: ProtocolName, population: Population, fold: Fold) -> Elements:
        """Return the recipe's placement for a fold, chosen from the population's rows as the protocol allows."""
        return self.chosen(may_choose(protocol, population, fold))

    def elements(self, rows: Rows) -> Elements:
        """Return the elements available in these rows."""
        return self.choices.available(np.sort(rows), self.recipe.levels)

    def chosen(self, rows: Rows, **changes: Any) -> Elements:
        """Return the elements that the recipe, with other choices `changes`, keeps from these rows, in any order."""
        recipe = changed(self.recipe, changes)
        countless = METHODS.named(recipe.placement).by_number and recipe.keep is None and not by_sensors(recipe)
        if not self._n_switches or countless:
            return ()
        return self.choices.elements(recipe, np.sort(rows))

    def _joints(self, elements: Elements, fold: Fold) -> Columns:
        if by_sensors(self.recipe):
            return self.choices.sensors(self.recipe, np.sort(fold.train)).joints
        return self.choices.joints(elements, fold.train, self.recipe.keep_joints)

    def _row(self, name: str, what: str, kind: Composition, select: Select, learner: str = "") -> RowPlan:
        return RowPlan(
            name, what, tuple(self.cell(population, kind, select, learner) for population in self.populations)
        )

    def cell(self, population: Population, kind: Composition, select: Select, learner: str = "") -> CellPlan:
        """Return the fits of a composition on every fold of a population; `select` returns the placement of a fold."""
        learner = learner or (AUTO if self.recipe.trainer == AUTO else "")

        def fit(fold: Fold) -> FoldFit:
            # All switches depend on no placement.
            placement = select(population, fold) if kind.selected != kind.others else ()
            elements = kind.elements(placement, self.elements(fold.train) if kind.others else ())
            return FoldFit(
                fold, elements, self._joints(elements, fold) if kind.angle else (), population.grasps, learner
            )

        return CellPlan(population, tuple(tuple(map(fit, folds)) for folds in population.repeats))
