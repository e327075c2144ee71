"""The rows of a frontier and their folds, in which switches are chosen and classifiers trained."""

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from msgspec import Struct
from msgspec.structs import replace as changed_to
from numpy.typing import NDArray

from thenar.runtime.manifest import Fitting, Unit
from thenar.runtime.model.tables import winners
from thenar.runtime.recipe import Inputs, Recipe

from ..evaluation.choosing import InputChoices, choose_path, choose_sensors, choose_training, rank_joints
from ..evaluation.folds import EvaluationError, Fold, Rows, leave_groups_out, trial_folds
from ..evaluation.rates import Rate
from ..placement.constraints import Limits
from ..placement.elements import Elements, names_of
from ..placement.placement import InputSelection
from ..placement.ports import PortCosts
from ..recogniser import Recogniser, predicted_classes
from ..recordings.graspset import GraspSet
from ..samples import Columns, Samples, decided
from ..trainers.base import Training
from ..wearer import STRENGTH, STRENGTHS
from ..wearer_study import Hits, Try, after_adaptation, hits_of, of_people
from .cache import Cache, stored
from .points import By, PointTime
from .price import Equipment, PricedTables, count_steps, price, time_here
from .search import SHAPES, TAXEL_LEVELS, Search

# Settings are selected on the placement whose number of switches is nearest to the paper's.
_TYPICAL = 33

K = TypeVar("K", bound=Hashable)
R = TypeVar("R")
# The rounds after which models are tested, and those after which tables are made.
Depth = tuple[tuple[int, ...], tuple[int, ...]]


@dataclass(frozen=True, slots=True, eq=False)
class Cuts:
    """The folds of a set, which keep every trial whole, and the trials of its rows (n,).

    repeats   stratified folds for "pooled" rates; of each seed, or only of the first if points are chosen by subjects
    subjects  folds that leave out a subject each; none if there is one subject
    by        the folds by which points are chosen
    trials    (n,) the trial of each row, 0 to m - 1; people (m,) the subject of each trial
    """

    repeats: tuple[tuple[Fold, ...], ...]
    subjects: tuple[Fold, ...]
    everything: Fold
    by: By
    trials: Rows
    people: Rows

    @classmethod
    def of(cls, samples: Samples, search: Search) -> "Cuts":
        """Return the folds for a search. Raises EvaluationError if there is too little to cut."""
        trials = np.unique(samples.trials, return_inverse=True)[1]
        people = samples.subjects[np.unique(trials, return_index=True)[1]]
        several = len(np.unique(people)) > 1
        if search.by == "subject" and not several:
            raise EvaluationError("leaving a subject out needs two or more subjects: choose by trials instead")
        rows = np.arange(len(trials))
        by_subject = (search.by or "subject") == "subject" and several
        seeds = range(search.seed, search.seed + (1 if by_subject else search.repeats))
        return cls(
            repeats=tuple(tuple(trial_folds(samples.labels, trials, search.folds, seed)) for seed in seeds),
            subjects=tuple(leave_groups_out(samples.subjects, "subject")) if several else (),
            everything=Fold(rows, rows[:0], "all"),
            by="new subject" if by_subject else "pooled",
            trials=trials,
            people=people,
        )

    def folds(self, by: By) -> tuple[tuple[Fold, ...], ...]:
        """Return the folds of each repeat for this kind of rate."""
        return (self.subjects,) if by == "new subject" else self.repeats

    @property
    def other(self) -> By | None:
        """The kind of the other rate, if there are several subjects."""
        if not self.subjects:
            return None
        return "pooled" if self.by == "new subject" else "new subject"

    @property
    def screening(self) -> tuple[Fold, ...]:
        """The first repeat of the folds by which points are chosen."""
        return self.folds(self.by)[0]

    @property
    def others(self) -> tuple[Fold, ...]:
        """Every other fold that is tested."""
        folds = (*(fold for folds in self.repeats for fold in folds), *self.subjects)
        return tuple(fold for fold in folds if fold not in self.screening)

    def judged(self, by: By, packed: Mapping[Fold, bytes], unit: Unit = "trials") -> "TrialAccuracy":
        """Return the rate of this kind over the available repeats, given the packed bits of each fold's trials, or of
        its rows for the unit "frames".
        """
        trials = np.arange(len(self.people)) if unit == "trials" else self.trials
        repeats = [folds for folds in self.folds(by) if packed.keys() >= set(folds)]
        hits = np.zeros((len(repeats), len(trials)), np.intp)
        for row, folds in zip(hits, repeats, strict=True):
            for fold in folds:
                tested = np.unique(self.trials[fold.test]) if unit == "trials" else fold.test
                row[tested] = np.unpackbits(np.frombuffer(packed[fold], np.uint8), count=len(tested))
        groups = self.people[trials] if by == "new subject" else None
        rate = Rate.predicted(hits, np.ones_like(trials), trials, of=by, unit=unit, groups=groups)
        return TrialAccuracy(rate, hits.sum(axis=0), len(repeats))


@dataclass(frozen=True, slots=True, eq=False)
class TrialAccuracy:
    """A rate of trials or frames, and in how many of `repeats` each of them (m,) was predicted rightly."""

    rate: Rate
    hits: NDArray[np.intp]
    repeats: int


class FoldHits(Struct, frozen=True):
    """Correctly predicted trials of a fold, by their numbers, eight to the byte.

    stages  after every stage           tables  by the tables of each shape after each tabled stage (stages x shapes)
    frames  the same tables' test rows, one by one; "" if each row is a separate trial
    """

    stages: tuple[bytes, ...]
    tables: tuple[tuple[bytes, ...], ...]
    frames: tuple[tuple[bytes, ...], ...]


@dataclass(frozen=True, eq=False)
class Survey:
    """Rows, the search, and the hardware options of the glove; with requested placements and fits, each computed once.

    source  name of the recordings
    ports   costs of reading switches and taxels on the whole glove, None if unknown
    limits  constraints on the sensors, and their prices
    """

    grasp_set: GraspSet
    source: str
    samples: Samples
    ports: PortCosts | None
    search: Search
    cuts: Cuts
    equipment: Equipment
    cache: Cache
    limits: Limits | None = None
    _trainings: dict[tuple[str, Inputs, Fold], Training] = field(default_factory=dict, init=False)

    @cached_property
    def inputs(self) -> InputChoices:
        """The elements and joints that recipes keep."""
        return InputChoices(self.samples, self.ports, self.limits, ask=self.cache.ask)

    @property
    def levels(self) -> tuple[int | None, ...]:
        """The numbers of levels of a taxel that are tried; only None if there are no taxels."""
        return TAXEL_LEVELS if self.samples.taxels.shape[1] else (None,)

    def size(self, levels: int | None) -> int:
        """Return how many elements there are to choose from in all rows."""
        return len(self.inputs.available(self.cuts.everything.train, levels))

    def elements(self, recipe: Recipe, fold: Fold | None = None) -> Elements:
        """Return the elements that a recipe keeps by the training rows of `fold`, or by all rows."""
        return self.inputs.elements(recipe, (fold or self.cuts.everything).train)

    def joints(self, recipe: Recipe, fold: Fold | None = None) -> Columns:
        """Return the joints of a recipe, ascending, by the training rows of `fold`, or by all rows."""
        rows = (fold or self.cuts.everything).train
        if recipe.sensors is not None or recipe.price is not None:
            return self.inputs.sensors(recipe, rows).joints
        if recipe.inputs == "switches":
            return ()
        return self.inputs.joints(self.elements(recipe, fold), rows, recipe.keep_joints)

    def selection(self, recipe: Recipe, fold: Fold | None = None) -> InputSelection:
        """Return the inputs that a recipe keeps by the training rows of `fold`, or by all rows."""
        return InputSelection.of(self.elements(recipe, fold), self.joints(recipe, fold))

    def names(self, recipe: Recipe) -> tuple[str, ...]:
        """Return the names of the elements that a recipe keeps by all rows."""
        return names_of(self.grasp_set, self.elements(recipe))

    def transfer(self, recipe: Recipe) -> PointTime:
        """Return the time of reading the joints of a recipe."""
        return self.equipment.records.of(len(self.joints(recipe)))

    def some_joints(self, recipe: Recipe) -> tuple[str, ...]:
        """Return the names of the joints of a recipe from all rows, if not all are kept."""
        if recipe.keep_joints is None and not self.search.by_sensors:
            return ()
        return tuple(self.grasp_set.joint_names[joint] for joint in self.joints(recipe))

    def size_of(self, recipe: Recipe) -> int:
        """Return the number of sensors that a recipe keeps by all rows."""
        return len({element.column for element in self.elements(recipe)}) + len(self.joints(recipe))

    def training(self, recipe: Recipe, fold: Fold | None = None) -> Training:
        """Return the training of a recipe on the training rows of a fold, or on all rows; call `tune` first."""
        place = recipe.trainer, recipe.inputs, fold or self.cuts.everything
        return self._trainings.get(place) or self.search.alone(recipe.trainer).candidates[0]

    def choose(self, recipes: Iterable[Recipe], folds: Sequence[Fold]) -> None:
        """Choose the switches and levels of all recipes from the training rows of these folds."""
        self.inputs.choose(recipes, [fold.train for fold in folds])

    def choose_joints(self, recipes: Iterable[Recipe], folds: Sequence[Fold]) -> None:
        """Rank the joints, given the switches, for recipes that keep only some, by the training rows of these folds."""
        some = [recipe for recipe in recipes if recipe.keep_joints is not None]
        places = dict.fromkeys((self.elements(recipe, fold), fold) for recipe in some for fold in folds)
        self.inputs.rank([(elements, fold.train) for elements, fold in places])

    def tune(self, recipes: Iterable[Recipe], folds: Sequence[Fold]) -> None:
        """Select the open settings of each trainer and kind of inputs on the training rows of these folds, as `compile`
        does: once, by the recipe of the most typical size.
        """
        alike: dict[tuple[str, Inputs], list[Recipe]] = {}
        for recipe in recipes:
            if len(self.search.alone(recipe.trainer).candidates) > 1:
                alike.setdefault((recipe.trainer, recipe.inputs), []).append(recipe)
        typical = {
            key: changed_to(min(several, key=lambda one: abs(len(self.elements(one)) - _TYPICAL)), keep_joints=None)
            for key, several in alike.items()
        }
        calls = {
            (*key, fold): (
                self.samples,
                fold.train,
                self.selection(recipe, fold),
                self.search.alone(recipe.trainer).candidates,
                self.search.seed,
                self.cuts.by == "new subject",
            )
            for key, recipe in typical.items()
            for fold in folds
        }
        for place, fitting in self._ask(choose_settings, calls).items():
            self._trainings[place] = Training.chosen(fitting)

    def fit(
        self, recipes: Sequence[Recipe], folds: Sequence[Fold], depth: Callable[[Recipe], Depth]
    ) -> dict[tuple[Recipe, Fold], FoldHits]:
        """Return the hits of every recipe in every fold, trained to its `depth`."""
        calls = {
            (recipe, fold): (
                self.samples,
                fold,
                self.selection(recipe, fold),
                *depth(recipe),
                SHAPES if depth(recipe)[1] else (),
                self.training(recipe, fold),
            )
            for recipe in recipes
            for fold in folds
        }
        return self._ask(fit_stages, calls)

    def adapted(self, recipes: Iterable[Recipe], own_trials: int) -> dict[Recipe, tuple[Rate, Rate]]:
        """Return the accuracy of the subjects left out before and after this number of their trials of each type, for
        tabled recipes. One subject must have more trials of a type.
        """
        # Without own trials no strength counts.
        tries = (0, STRENGTH), *((own_trials, strength) for strength in STRENGTHS)
        calls = {
            (recipe, fold): (
                self.samples,
                fold,
                self.selection(recipe, fold),
                self.training(recipe, fold),
                recipe,
                tries,
            )
            for recipe in recipes
            for fold in self.cuts.subjects
        }
        people: dict[Recipe, list[Hits]] = {}
        for (recipe, _), hits in self._ask(adapt_to_left_out, calls).items():
            people.setdefault(recipe, []).extend(hits)
        return {
            recipe: (
                of_people(hits, [0] * len(hits), "new subject"),
                after_adaptation([(correct[1:], total) for correct, total in hits]),
            )
            for recipe, hits in people.items()
        }

    def prices(
        self, tables: Mapping[Recipe, tuple[Recipe, ...]], rows: Rows, *, lost: bool = False
    ) -> dict[Recipe, tuple[PricedTables, ...]]:
        """Return the prices of recipes trained on these rows, each with several tables; see `price`."""
        calls = {
            recipe: (
                self.samples,
                self.names(recipe),
                rows,
                self.selection(recipe),
                several,
                self.training(recipe),
                self.equipment,
                lost,
            )
            for recipe, several in tables.items()
        }
        return self._ask(price, calls)

    def measured(self, contents: Iterable[bytes]) -> dict[bytes, PointTime]:
        """Return the time of classifying with each of these tables.bin, simulated or measured; none if impossible."""
        model, several = self.equipment.model, tuple(dict.fromkeys(contents))
        if model.unmeasured:
            return {}
        if model.python is None:
            steps = self.cache.ask(count_steps, [(content, model) for content in several])
            times = [PointTime(model.us(round(count)), "simulated") for count in steps]
        else:
            (times_us,) = self.cache.ask(time_here, [(several, model.python[-1])])
            times = [PointTime(us, "measured") for us in times_us]
        return dict(zip(several, times, strict=True))

    def _ask(self, function: Callable[..., R], calls: Mapping[K, tuple[Any, ...]]) -> dict[K, R]:
        """Return the result of a stored function for each tuple of arguments."""
        return dict(zip(calls, self.cache.ask(function, list(calls.values())), strict=True))


stored(5)(choose_path)
stored(1)(choose_sensors)
stored(3)(rank_joints)


@stored(4)
def choose_settings(
    samples: Samples,
    rows: Rows,
    selection: InputSelection,
    candidates: tuple[Training, ...],
    seed: int,
    by_subject: bool,
) -> Fitting:
    """Select settings by inner folds of some rows, on the selected inputs."""
    learning = selection.read(samples.rows(rows))
    return choose_training(learning, candidates, seed=seed, groups=learning.subjects if by_subject else None)


@stored(4)
def fit_stages(
    samples: Samples,
    fold: Fold,
    selection: InputSelection,
    stages: tuple[int, ...],
    tabled: tuple[int, ...],
    shapes: tuple[Recipe, ...],
    training: Training,
) -> FoldHits:
    """Train once on a fold's training rows, on the selected inputs; test at every stage.

    Rows get the most frequent type if no selected input varies.
    """
    train, test = (selection.read(samples.rows(rows)) for rows in (fold.train, fold.test))
    if not train.varies:
        trials, frames = _packed(np.full(len(test.labels), train.most_frequent), test)
        by_table = [[(trials, frames)] * len(shapes)] * len(tabled)
        by_stage = (trials,) * len(stages)
    else:
        rounds = (*stages, *tabled)
        recognisers = Recogniser.stages(samples, Recipe(), fold.train, selection, training, rounds)
        trained = dict(zip(rounds, recognisers, strict=True))
        predictions = (winners(trained[stage].model.scores(test.switches, test.codes)) for stage in stages)
        by_stage = tuple(_packed(predicted, test)[0] for predicted in predictions)
        by_table = [
            [
                _packed(predicted_classes(tables, None, test.switches, test.codes), test)
                for tables in (replace(trained[stage], recipe=shape).integers for shape in shapes)
            ]
            for stage in tabled
        ]
    return FoldHits(
        by_stage,
        tables=tuple(tuple(trials for trials, _ in row) for row in by_table),
        frames=tuple(tuple(frames for _, frames in row) for row in by_table),
    )


@stored(1)
def adapt_to_left_out(
    samples: Samples, fold: Fold, selection: InputSelection, training: Training, recipe: Recipe, tries: tuple[Try, ...]
) -> list[Hits]:
    """Train a tabled recipe on a fold's training rows, and adapt to each subject of its test rows; see `hits_of`."""
    (recogniser,) = Recogniser.stages(samples, recipe, fold.train, selection, training, (recipe.rounds or 1,))
    return hits_of(recogniser, samples.rows(fold.test), tries)


def _packed(predictions: Rows, test: Samples) -> tuple[bytes, bytes]:
    """Return which trials, in the order of their numbers, and which rows were predicted rightly; see FoldHits."""
    _, first, trials = np.unique(test.trials, return_index=True, return_inverse=True)
    right = np.packbits(decided(predictions[None], trials)[0] == test.labels[first]).tobytes()
    return right, np.packbits(predictions == test.labels).tobytes() if len(first) < len(trials) else b""
