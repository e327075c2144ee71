"""Plan the fits for each table (inputs, placement, folds), and run each distinct fit once."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.model.tables import winners
from thenar.runtime.recipe import AUTO, Recipe, changed

from ..placement.elements import Elements, bits_of, elements_of
from ..placement.methods.base import METHODS, PAPERS
from ..placement.methods.baselines import random_placement
from ..placement.methods.elimination import joint_order
from ..placement.placement import Placer
from ..recordings.graspset import GraspSet
from ..samples import Columns, Samples
from ..trainers.base import TRAINERS, Training
from ..workers import in_workers
from .choosing import choose_training
from .folds import Fold, Rows
from .populations import Population, Protocol, Scheme, groups_of

Labels = NDArray[np.intp]
Progress = Callable[[int, int], None]
# For each trainer, the candidates among which each fit chooses.
Ways = Mapping[str, tuple[Training, ...]]
# Classifiers of scikit-learn with its own settings, neighbours weighted by distance: to compare the trainers with.
CLASSIFIERS = ("logistic-regression", "5-nearest-neighbours")


@dataclass(frozen=True, slots=True, eq=False)
class Data:
    """All rows from which fits take elements and joints, with their labels (n,) in the taxonomy.

    groups (n,) are what each row is left out with, None: its trial.
    """

    samples: Samples
    labels: Labels
    groups: NDArray[np.str_] | None

    @classmethod
    def of(cls, grasp_set: GraspSet, scheme: Scheme = "trial") -> "Data":
        """Return the rows of a set."""
        return cls(Samples.of(grasp_set), grasp_set.labels, groups_of(grasp_set, scheme))

    @property
    def trials(self) -> Rows:
        """The trial (n,) of each row."""
        return self.samples.trials


@dataclass(frozen=True, slots=True)
class FoldFit:
    """Train on a fold's training rows with these elements, joints, and classes `grasps` (ascending labels); then test.

    `learner` is a trainer or AUTO, whose settings are chosen on the training rows, or one of CLASSIFIERS; "": the
    trainer and settings of the recipe. Two fits are equal if they have the same `Fold` object, inputs and learner.
    """

    fold: Fold
    elements: Elements
    joints: Columns
    grasps: tuple[int, ...]
    learner: str = ""

    def read(self, data: Data) -> Samples:
        """Return all rows with only these inputs."""
        return bits_of(data.samples.with_joints(self.joints), self.elements)


def predictions(data: Data, fit: FoldFit, training: Training, ways: Ways | None = None) -> Labels:
    """Return the labels predicted for the fold's test rows, by `training` or the fit's learner among `ways`.

    A blind fit predicts the most frequent label of the training rows (the lowest of several), which is the accuracy to
    beat.
    """
    grasps, rows = np.array(fit.grasps, dtype=np.intp), fit.fold.train
    trained = np.searchsorted(grasps, data.labels[rows])
    if is_blind(data, fit):
        return np.full(len(fit.fold.test), grasps[np.bincount(trained).argmax()])
    read = fit.read(data)
    learning = replace(read.rows(rows), labels=trained, grasps=tuple(map(str, fit.grasps)))
    test = read.rows(fit.fold.test)
    if fit.learner in CLASSIFIERS:
        return grasps[_classified(fit.learner, learning, test.inputs)]
    if fit.learner:
        groups = None if data.groups is None else data.groups[rows]
        fitting = choose_training(learning, (ways or {})[fit.learner], groups=groups)
        training = Training.chosen(fitting, masked=training.masked)
    return grasps[winners(training.train(learning).scores(test.switches, test.codes))]


def _classified(name: str, learning: Samples, X: NDArray[np.generic]) -> Labels:
    """Return the class numbers that one of CLASSIFIERS, on standardised inputs, predicts for rows X (n, d)."""
    from sklearn.linear_model import LogisticRegression
    from sklearn.neighbors import KNeighborsClassifier
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    # scikit-learn's classifiers cannot be fitted to a single class.
    if (learning.labels == learning.labels[0]).all():
        return np.full(len(X), learning.labels[0])
    logistic = name == "logistic-regression"
    classifier = LogisticRegression(max_iter=10_000) if logistic else KNeighborsClassifier(5, weights="distance")
    made = make_pipeline(StandardScaler(), classifier).fit(learning.inputs.astype(np.float64), learning.labels)
    return np.asarray(made.predict(X.astype(np.float64)), dtype=np.intp)


def is_blind(data: Data, fit: FoldFit) -> bool:
    """Return whether none of a fit's inputs varies among its training rows."""
    inputs = fit.read(data).inputs[fit.fold.train]
    return not (inputs != inputs[0]).any()


def run_fits(
    data: Data,
    fits: Iterable[FoldFit],
    training: Training,
    jobs: int = -1,
    progress: Progress | None = None,
    ways: Ways | None = None,
) -> dict[FoldFit, Labels]:
    """Return the predictions of every fit. Equal fits are run once; `progress(done, total)` is called after each.

    jobs  worker processes, as in joblib: -1 for all cores, 1 for this process only. A worker runs one thread. Sums in
          boosting are exact, so the result does not depend on the number of workers.
    """
    todo = list(dict.fromkeys(fits))
    results: dict[FoldFit, Labels] = {}
    tasks = ((number, data, fit, training, ways) for number, fit in enumerate(todo))
    for number, found in in_workers(_numbered, tasks, jobs):
        results[todo[number]] = found
        if progress is not None:
            progress(len(results), len(todo))
    return results


def _numbered(task: tuple[int, Data, FoldFit, Training, Ways | None]) -> tuple[int, Labels]:
    number, data, fit, training, ways = task
    return number, predictions(data, fit, training, ways)


@dataclass(frozen=True, slots=True)
class Composition:
    """The inputs of a classifier: the joints (Angle), the placement's switches (Sel-Co), the others (NoSel-Co)."""

    name: str
    what: str
    angle: bool
    selected: bool
    others: bool

    @property
    def needs_placement(self) -> bool:
        """Whether its columns depend on the selected switches."""
        return self.selected != self.others

    @property
    def has_switches(self) -> bool:
        """Whether it uses any switches."""
        return self.selected or self.others

    def elements(self, placement: Elements, every: Elements) -> Elements:
        """Return the elements that it uses, ascending, given the selected and the available ones."""
        kept = set(placement)
        return tuple(sorted([*kept] * self.selected + [one for one in every if one not in kept] * self.others))


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
    return tuple(c for c in COMPOSITIONS if (n_joints or not c.angle) and (n_switches or not c.has_switches))


TableName = Literal["compositions", "generality", "pruning", "baselines", "trainers", "joints"]
Select = Callable[[Population, Fold], Elements]

BASELINES = ("cmim", "mutual-information")
REFERENCE = "logitboost"  # the trainer with which the others are compared
JOINTS = (1, 2, 3, 4, 5, 6, 8, 10, 12, 14, 16, 18)  # numbers of kept joints, without switches
DRAWS = 5  # random placements to compare with


def learners() -> tuple[str, ...]:
    """Return the methods in the table of trainers: REFERENCE, the other trainers that can be chosen automatically, and
    CLASSIFIERS.
    """
    return tuple(dict.fromkeys([REFERENCE, *(name for name in TRAINERS if TRAINERS[name].tried), *CLASSIFIERS]))


def ways_of(recipe: Recipe) -> Ways:
    """Return the candidates of each trainer, and of AUTO: requested settings apply to the trainers that have them."""
    trainers = [name for name in learners() if name not in CLASSIFIERS]
    own = {name: recipe if name == recipe.trainer else Recipe(trainer=name) for name in (*trainers, recipe.trainer)}
    return {name: Training.candidates(each) for name, each in own.items()}


@dataclass(frozen=True, slots=True)
class CellPlan:
    """The fits of one cell: `runs` of folds, one per repeat; a cell of random draws has all repeats of each draw."""

    part: Population
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

    samples  of all rows; placer: chooses elements from the training rows, and its recipe says how many joints
             classifiers get, chosen from the training rows, given the switches; baselines: methods to compare with.
             A placement is chosen once from the same rows.
    """

    parts: tuple[Population, ...]
    samples: Samples
    placer: Placer
    prune_list: tuple[int, ...] = ()
    baselines: tuple[str, ...] = BASELINES
    _chosen: dict[tuple[str, int | None, int, bytes], Elements] = field(default_factory=dict, init=False, repr=False)
    _elements: dict[bytes, Elements] = field(default_factory=dict, init=False, repr=False)
    _joint_orders: dict[tuple[Elements, bytes], Columns] = field(default_factory=dict, init=False, repr=False)

    @property
    def recipe(self) -> Recipe:
        """The recipe of the classifiers."""
        return self.placer.recipe

    def table(self, name: TableName, protocol: Protocol) -> list[RowPlan]:
        """Return the rows of a table under a protocol."""
        rows: dict[TableName, Callable[[Protocol], list[RowPlan]]] = {
            "compositions": self._compositions,
            "generality": self._generality,
            "pruning": self._pruning,
            "baselines": self._baselines,
            "trainers": self._trainers,
            "joints": lambda _: self._best_joints(),
        }
        return rows[name](protocol)

    def _compositions(self, protocol: Protocol) -> list[RowPlan]:
        chosen = partial(self.own, protocol)
        kinds = available(self._n_switches, self.n_joints)
        return [self._row(kind.name, kind.what, kind, chosen) for kind in kinds]

    def _generality(self, protocol: Protocol) -> list[RowPlan]:
        def chosen_by(giver: Population, part: Population, fold: Fold) -> Elements:
            # Another subject's placement has never seen this subject's rows: both protocols allow it.
            own = part is giver
            return self.own(protocol, part, fold) if own else self.chosen(giver.rows)

        return [
            self._row(giver.name, f"placement of subject {giver.name}", SELECTED, partial(chosen_by, giver))
            for giver in self.parts
        ]

    def _pruning(self, protocol: Protocol) -> list[RowPlan]:
        everyone = np.unique(np.concatenate([part.rows for part in self.parts]))

        def pooled(least: int, part: Population, fold: Fold) -> Elements:
            return self.chosen(protocol.may_choose_pooled(everyone, fold), prune=least)

        everything = self._row("all", "all switches", ALL_SWITCHES, lambda part, fold: ())
        pruned = [self._row(str(s), f"S = {s}", SELECTED, partial(pooled, s)) for s in self.prune_list]
        return [everything, *pruned]

    def _baselines(self, protocol: Protocol) -> list[RowPlan]:
        def baseline(name: str, part: Population, fold: Fold) -> Elements:
            number = len(self.own(protocol, part, fold))
            return self.chosen(protocol.may_choose(part, fold), placement=name, keep=number or None, prune=0)

        def drawn(draw: int, part: Population, fold: Fold) -> Elements:
            every = self.elements(fold.train)
            places = random_placement(len(every), len(self.own(protocol, part, fold)), self.recipe.seed + draw)
            return tuple(every[place] for place in places)

        recipe = METHODS.named(self.recipe.placement)
        what = "the paper's placement" if recipe.name == PAPERS else recipe.help
        baselines = [METHODS.named(name) for name in self.baselines if name != recipe.name]
        draws = [self._row("random", f"mean of {DRAWS} draws", SELECTED, partial(drawn, draw)) for draw in range(DRAWS)]
        return [
            self._row(recipe.title, what, SELECTED, partial(self.own, protocol)),
            *(self._row(each.title, each.help, SELECTED, partial(baseline, each.name)) for each in baselines),
            replace(draws[0], cells=tuple(map(_joined, zip(*(draw.cells for draw in draws), strict=True)))),
        ]

    def _trainers(self, protocol: Protocol) -> list[RowPlan]:
        chosen = partial(self.own, protocol)
        # Choosing settings takes as long as many fits: a single repeat is run.
        once = replace(self, parts=tuple(replace(part, repeats=part.repeats[:1]) for part in self.parts))
        return [once._row(name, kind.what, kind, chosen, name) for kind in self.kinds for name in learners()]

    def _best_joints(self) -> list[RowPlan]:
        sizes = [*(size for size in JOINTS if size < self.n_joints), self.n_joints]
        return [self._row(str(n), f"the best {n} joints", ANGLE, lambda *_: (), most=n) for n in sizes]

    @property
    def kinds(self) -> tuple[Composition, ...]:
        """The inputs for comparing trainers: selected switches and joints, as far as available, and each alone."""
        there = available(self._n_switches, self.n_joints)
        return tuple(kind for kind in (ANGLE_SELECTED, ANGLE, SELECTED) if kind in there)

    @property
    def n_joints(self) -> int:
        """The number of joints."""
        return int(self.samples.codes.shape[1])

    @property
    def _n_switches(self) -> int:
        return self.samples.n_switches + int(self.samples.taxels.shape[1])

    def own(self, protocol: Protocol, part: Population, fold: Fold) -> Elements:
        """Return the recipe's placement for a fold, chosen from the population's own rows as the protocol allows."""
        return self.chosen(protocol.may_choose(part, fold))

    def elements(self, rows: Rows) -> Elements:
        """Return the elements available in these rows."""
        key = rows.tobytes()
        if key not in self._elements:
            self._elements[key] = elements_of(self.samples.rows(rows), self.recipe.levels)
        return self._elements[key]

    def chosen(self, rows: Rows, **changes: Any) -> Elements:
        """Return the elements that the recipe, with other choices `changes`, keeps from these rows, in any order."""
        recipe = changed(self.recipe, changes)
        method = METHODS.named(recipe.placement)
        if not self._n_switches or (method.by_number and recipe.keep is None):
            return ()
        rows = np.sort(rows)
        key = method.name, recipe.keep, recipe.prune, rows.tobytes()
        if key not in self._chosen:
            self._chosen[key] = self.placer.elements(self.samples.rows(rows), **changes)
        return self._chosen[key]

    def joints(self, rows: Rows, elements: Elements, most: int | None) -> Columns:
        """Return the best joints, ascending, at most `most`, given these elements and rows; None: all."""
        if most is None or most >= self.n_joints:
            return tuple(range(self.n_joints))
        key = elements, rows.tobytes()
        if key not in self._joint_orders:
            self._joint_orders[key] = joint_order(bits_of(self.samples.rows(rows), elements))
        return tuple(sorted(self._joint_orders[key][:most]))

    def _row(
        self, name: str, what: str, kind: Composition, select: Select, learner: str = "", most: int | None = None
    ) -> RowPlan:
        return RowPlan(name, what, tuple(self.cell(part, kind, select, learner, most) for part in self.parts))

    def cell(
        self, part: Population, kind: Composition, select: Select, learner: str = "", most: int | None = None
    ) -> CellPlan:
        """Return the fits of composition `kind` on every fold of `part`.

        `select` returns the placement for a fold, and `most` is the number of joints kept, None: the recipe's.
        """
        learner = learner or (AUTO if self.recipe.trainer == AUTO else "")

        def fit(fold: Fold) -> FoldFit:
            placement = select(part, fold) if kind.needs_placement else ()
            elements = kind.elements(placement, self.elements(fold.train) if kind.others else ())
            joints = self.joints(fold.train, elements, most or self.recipe.keep_joints) if kind.angle else ()
            return FoldFit(fold, elements, joints, part.grasps, learner)

        return CellPlan(part, tuple(tuple(map(fit, folds)) for folds in part.repeats))


def _joined(cells: tuple[CellPlan, ...]) -> CellPlan:
    """Return one cell that holds the runs of all."""
    return CellPlan(cells[0].part, tuple(run for cell in cells for run in cell.runs))
