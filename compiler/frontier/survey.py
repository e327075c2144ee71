"""The rows of a frontier and their folds, in which switches are chosen and classifiers trained."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from msgspec import Struct
from msgspec.structs import replace as changed_to
from numpy.typing import NDArray

from thenar.runtime.manifest import Fitting
from thenar.runtime.model.tables import winners
from thenar.runtime.recipe import Inputs, Recipe

from ..evaluation.choosing import choose_training
from ..evaluation.folds import EvaluationError, Fold, Rows, leave_groups_out, trial_folds
from ..evaluation.rates import Rate
from ..placement.elements import Elements, bits_of, elements_of, names_of, ports_of
from ..placement.methods.base import METHODS
from ..placement.methods.elimination import joint_order
from ..placement.placement import InputSelection
from ..placement.ports import PortCosts
from ..recogniser import Recogniser, predicted_classes
from ..recordings.graspset import GraspSet
from ..samples import Columns, Samples, decided
from ..trainers.base import Training
from .cache import Cache, stored
from .points import By, PointTime
from .price import Equipment, PricedTables, price
from .search import SHAPES, TAXEL_LEVELS, Choosing, Search, chosen_by, placement_of

# Settings are selected on the placement whose number of switches is nearest to the paper's.
_TYPICAL = 33


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
        every = (*(fold for folds in self.repeats for fold in folds), *self.subjects)
        return tuple(fold for fold in every if fold not in self.screening)

    def judged(self, by: By, packed: Mapping[Fold, bytes]) -> "TrialAccuracy":
        """Return the rate of this kind, given the packed bits of each fold's trials, over the available repeats."""
        repeats = [folds for folds in self.folds(by) if packed.keys() >= set(folds)]
        hits = np.zeros((len(repeats), len(self.people)), np.intp)
        for own, folds in zip(hits, repeats, strict=True):
            for fold in folds:
                tested = np.unique(self.trials[fold.test])
                own[tested] = np.unpackbits(np.frombuffer(packed[fold], np.uint8), count=len(tested))
        everyone = np.arange(len(self.people))
        groups = self.people if by == "new subject" else None
        rate = Rate.predicted(hits, np.ones_like(everyone), everyone, of=by, groups=groups)
        return TrialAccuracy(rate, hits.sum(axis=0), len(repeats))

    def frames(self, packed: Mapping[Fold, bytes]) -> Rate:
        """Return the rate of single frames by which points are chosen, by the packed bits of each fold's rows."""
        by, repeats = self.by, self.folds(self.by)
        hits = np.zeros((len(repeats), len(self.trials)), np.intp)
        for own, folds in zip(hits, repeats, strict=True):
            for fold in folds:
                own[fold.test] = np.unpackbits(np.frombuffer(packed[fold], np.uint8), count=len(fold.test))
        groups = self.people[self.trials] if by == "new subject" else None
        return Rate.predicted(hits, np.ones_like(self.trials), self.trials, of=by, unit="frames", groups=groups)


@dataclass(frozen=True, slots=True, eq=False)
class TrialAccuracy:
    """A rate of trials, and in how many of `repeats` each trial (m,) was predicted rightly."""

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
    """

    grasp_set: GraspSet
    source: str
    samples: Samples
    ports: PortCosts | None
    search: Search
    cuts: Cuts
    equipment: Equipment
    cache: Cache
    _elements: dict[tuple[Choosing, float, Fold], Elements] = field(default_factory=dict, init=False)
    _joints: dict[tuple[Choosing, float, Fold], Columns] = field(default_factory=dict, init=False)
    _trainings: dict[tuple[str, Inputs, Fold], Training] = field(default_factory=dict, init=False)

    @property
    def levels(self) -> tuple[int | None, ...]:
        """The numbers of levels of a taxel that are tried; only None if there are no taxels."""
        return TAXEL_LEVELS if self.samples.taxels.shape[1] else (None,)

    def size(self, levels: int | None) -> int:
        """Return how many elements there are to choose from in all rows."""
        return len(elements_of(self.samples, levels))

    def elements(self, choice: Recipe, fold: Fold | None = None) -> Elements:
        """Return the elements that a choice keeps by the training rows of `fold`, or by all rows, once chosen."""
        if choice.inputs == "joints":
            return ()
        return self._elements[chosen_by(choice), placement_of(choice).parameter, fold or self.cuts.everything]

    def joints(self, choice: Recipe, fold: Fold | None = None) -> Columns:
        """Return the joints of a choice, ascending, once ranked on the training rows of `fold`, or on all rows."""
        if choice.keep_joints is None or choice.inputs == "switches":
            return () if choice.inputs == "switches" else tuple(range(self.n_joints))
        place = chosen_by(choice), placement_of(choice).parameter, fold or self.cuts.everything
        return tuple(sorted(self._joints[place][: choice.keep_joints]))

    def selection(self, choice: Recipe, fold: Fold | None = None) -> InputSelection:
        """Return the inputs that a choice keeps by the training rows of `fold`, or by all rows."""
        return InputSelection.of(self.elements(choice, fold), self.joints(choice, fold))

    def names(self, choice: Recipe) -> tuple[str, ...]:
        """Return the names of the elements that a choice keeps by all rows."""
        return names_of(self.grasp_set, self.elements(choice))

    @property
    def n_joints(self) -> int:
        """How many joints a frame has."""
        return int(self.samples.codes.shape[1])

    def transfer(self, choice: Recipe) -> PointTime:
        """Return the time of reading the joints of a choice."""
        return self.equipment.records.of(len(self.joints(choice)))

    def some_joints(self, choice: Recipe) -> tuple[str, ...]:
        """Return the names of the joints of a choice from all rows, if not all are kept."""
        names = self.grasp_set.joint_names
        return () if choice.keep_joints is None else tuple(names[joint] for joint in self.joints(choice))

    def training(self, choice: Recipe, fold: Fold | None = None) -> Training:
        """Return the training of a choice on the training rows of a fold, or on all rows; call `tune` first."""
        place = choice.trainer, choice.inputs, fold or self.cuts.everything
        return self._trainings.get(place) or self.search.alone(choice.trainer).candidates[0]

    def typical(self, choices: Iterable[Recipe]) -> list[Recipe]:
        """Return, for each trainer and kind of inputs with open settings, the choice that selects them."""
        alike: dict[tuple[str, Inputs], list[Recipe]] = {}
        for choice in choices:
            if len(self.search.alone(choice.trainer).candidates) > 1:
                alike.setdefault((choice.trainer, choice.inputs), []).append(choice)
        return [min(mine, key=lambda one: abs(len(self.elements(one)) - _TYPICAL)) for mine in alike.values()]

    def tune(self, typical: Sequence[Recipe], folds: Sequence[Fold]) -> None:
        """Select open settings on the training rows of these folds, as `compile` does: by typical choices, once for all
        of the same trainer and inputs.
        """
        places = [(choice, fold) for choice in typical for fold in folds]
        calls = [
            (
                self.samples,
                fold.train,
                self.selection(changed_to(choice, keep_joints=None), fold),
                self.search.alone(choice.trainer).candidates,
                self.search.seed,
                self.cuts.by == "new subject",
            )
            for choice, fold in places
        ]
        for (choice, fold), fitting in zip(places, self.cache.ask(choose_settings, calls), strict=True):
            self._trainings[choice.trainer, choice.inputs, fold] = Training.chosen(fitting)

    def choose(self, choices: Iterable[Recipe], folds: Sequence[Fold]) -> None:
        """Choose the switches and levels of all choices from the training rows of these folds."""
        asked: dict[Choosing, dict[float, None]] = {}
        for choice in choices:
            if choice.inputs != "joints":
                asked.setdefault(chosen_by(choice), {})[placement_of(choice).parameter] = None
        places = [(key, fold) for key in asked for fold in folds]
        calls = [
            (self.samples, fold.train, *key, tuple(asked[key]), self.ports if METHODS[key[0]].uses_ports else None)
            for key, fold in places
        ]
        for (key, fold), path in zip(places, self.cache.ask(choose_path, calls), strict=True):
            for number, elements in zip(asked[key], path, strict=True):
                self._elements[key, number, fold] = elements

    def choose_joints(self, choices: Iterable[Recipe], folds: Sequence[Fold]) -> None:
        """Rank the joints, given the switches, for choices that keep only some, by the training rows of these folds."""
        some = (one for one in choices if one.keep_joints is not None)
        alike = {(chosen_by(one), placement_of(one).parameter): one for one in some}
        places = [(key, fold) for key in alike for fold in folds]
        calls = [(self.samples, fold.train, self.elements(alike[key], fold)) for key, fold in places]
        for (key, fold), order in zip(places, self.cache.ask(rank_joints, calls), strict=True):
            self._joints[(*key, fold)] = order

    def fit(
        self,
        choices: Sequence[Recipe],
        folds: Sequence[Fold],
        depth: Callable[[Recipe], Depth],
    ) -> dict[tuple[Recipe, Fold], FoldHits]:
        """Return the tallies of every choice in every fold, trained to its `depth`."""
        places = [(choice, fold) for choice in choices for fold in folds]
        calls = [
            (
                self.samples,
                fold,
                self.selection(choice, fold),
                *depth(choice),
                SHAPES if depth(choice)[1] else (),
                self.training(choice, fold),
            )
            for choice, fold in places
        ]
        return dict(zip(places, self.cache.ask(fit_stages, calls), strict=True))

    def prices(
        self, several: Sequence[tuple[Recipe, tuple[Recipe, ...]]], rows: Rows, *, lost: bool = False
    ) -> list[tuple[PricedTables, ...]]:
        """Return the prices of choices trained on these rows, each with the tables of several recipes; see `price`."""
        calls = [
            (
                self.samples,
                self.names(choice),
                rows,
                self.selection(choice),
                recipes,
                self.training(choice),
                self.equipment,
                lost,
            )
            for choice, recipes in several
        ]
        return self.cache.ask(price, calls)


@stored(3)
def choose_path(
    samples: Samples,
    rows: Rows,
    method: str,
    joints: bool,
    levels: int | None,
    numbers: tuple[float, ...],
    ports: PortCosts | None,
) -> tuple[Elements, ...]:
    """Choose from these levels of the taxels, and the switches, in some rows by one method, for each of its numbers;
    given the joints, or not.
    """
    learning = samples.rows(rows)
    elements = elements_of(learning, levels)
    bits = bits_of(learning if joints else learning.with_joints(()), elements)
    choose = METHODS[method].chooser(bits, None if ports is None else ports_of(ports, elements))
    return tuple(tuple(elements[column] for column in choose(number)) for number in numbers)


@stored(2)
def rank_joints(samples: Samples, rows: Rows, elements: Elements) -> Columns:
    """Return the joints in the order of their value in addition to these elements, in some rows."""
    return joint_order(bits_of(samples.rows(rows), elements))


@stored(3)
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
    if not (train.inputs != train.inputs[0]).any():
        same = np.full(len(test.labels), np.bincount(train.labels).argmax())
        trials, frames = _packed(same, test)
        return FoldHits((trials,) * len(stages), *(((each,) * len(shapes),) * len(tabled) for each in (trials, frames)))
    rounds = (*stages, *tabled)
    made = dict(zip(rounds, Recogniser.stages(samples, Recipe(), fold.train, selection, training, rounds), strict=True))
    predictions = (winners(made[stage].model.scores(test.switches, test.codes)) for stage in stages)
    by_stage = tuple(_packed(predicted, test)[0] for predicted in predictions)
    found = [
        [
            _packed(predicted_classes(tables, None, test.switches, test.codes), test)
            for tables in (replace(made[stage], recipe=shape).integers for shape in shapes)
        ]
        for stage in tabled
    ]
    return FoldHits(by_stage, *(tuple(tuple(each[which] for each in row) for row in found) for which in (0, 1)))


def _packed(predictions: Rows, test: Samples) -> tuple[bytes, bytes]:
    """Return which trials, in the order of their numbers, and which rows were predicted rightly; see FoldHits."""
    _, first, trials = np.unique(test.trials, return_index=True, return_inverse=True)
    right = np.packbits(decided(predictions[None], trials)[0] == test.labels[first]).tobytes()
    return right, np.packbits(predictions == test.labels).tobytes() if len(first) < len(trials) else b""
