"""What is chosen inside the training rows: elements and joints, and by inner folds the trainer and its settings.

Inner folds split no movement; if the fit is to generalise to new subjects (objects, sessions), they also leave subjects
out. Each candidate is scored by its accuracy on trials, ties by log-loss: that of its scores times the best factor, as
trainers differ in how sure they are. Candidates within one standard error of the difference to the best are considered
equal; of these, those with small tables are cheap to deploy, and the one with the lowest log-loss among them is taken.
Rows in which nothing is held count only in the log-loss. For trials of many frames, a subset of the frames suffices for
the comparison. After the first fold only the candidates of least log-loss go on, and the most accurate one.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from math import fsum, sqrt
from typing import Any

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from thenar.runtime.manifest import Compared, Fitting, Of
from thenar.runtime.recipe import Inputs, Recipe

from ..elementary import softmax_and_loss
from ..model.collapse import collapse
from ..placement.constraints import Limits
from ..placement.elements import Elements, bits_of, elements_of, ports_of
from ..placement.methods.base import METHODS, by_sensors
from ..placement.methods.elimination import joint_order
from ..placement.placement import InputSelection, select
from ..placement.ports import PortCosts
from ..placement.sensors import read_by, search_of
from ..samples import Columns, Samples, decided
from ..trainers.base import TRAINERS, Model, Training
from ..workers import in_workers
from .folds import Fold, Rows, leave_groups_out, trial_folds

# Returns the results of a function for several tuples of arguments.
Ask = Callable[[Callable[..., Any], Sequence[tuple[Any, ...]]], list[Any]]

# Training sets with fewer trials than this are cut into this many inner folds, larger ones into two.
_FOLDS = ((1500, 4), (20_000, 3))
_LEAST_GROUPS = 3
# Tables of eight kilobytes, at a byte per entry, fit the smallest microcontrollers; larger ones are small up to a
# quarter above the smallest.
_SMALL, _LARGER = 8192, 1.25
# Factors of scores, of which each candidate has the best.
_FACTORS = tuple(2.0**exponent for exponent in range(-6, 4))
# Frames of a trial resemble their neighbours: of more rows than this, evenly spaced ones suffice to compare fits, at
# least this many per trial.
_COMPARED, _FRAMES = 2048, 8
# Candidates that go on by their log-loss. On our sets this takes a third less time, and no accuracy falls.
_AHEAD = 3


def choose_path(
    samples: Samples,
    rows: Rows,
    recipe: Recipe,
    numbers: tuple[float, ...],
    elements: Elements,
    ports: PortCosts | None = None,
    limits: Limits | None = None,
) -> tuple[Elements, ...]:
    """Return which of `elements` a recipe keeps by some rows, for each of several numbers that its method takes."""
    learning, method = samples.rows(rows), METHODS.named(recipe.placement)
    learning = learning if recipe.inputs == "both" else learning.with_joints(())
    if recipe.robust or limits is not None:
        name = "keep" if method.by_number else "prune"
        recipes = [replace(recipe, **{name: int(number)}) for number in numbers]
        return tuple(select(learning, numbered, ports, limits).kept for numbered in recipes)
    choose = method.chooser(bits_of(learning, elements), None if ports is None else ports_of(ports, elements))
    return tuple(tuple(elements[column] for column in choose(number)) for number in numbers)


def choose_sensors(
    samples: Samples, rows: Rows, recipe: Recipe, numbers: tuple[int | None, ...], limits: Limits | None
) -> tuple[tuple[Elements, Columns], ...]:
    """Return the elements and joints of the sensors that are kept by some rows, for each of several numbers of them;
    None: the best that the price of the recipe pays for.
    """
    learning = samples.rows(rows)
    search, elements = search_of(learning, limits), elements_of(learning, recipe.levels)
    chosen = (read_by(learning, elements, search.chosen(number).sensors) for number in numbers)
    return tuple((tuple(elements[column] for column in columns), joints) for columns, joints in chosen)


def rank_joints(samples: Samples, rows: Rows, elements: Elements) -> Columns:
    """Return the joints in the order of their value in addition to these elements, in some rows."""
    return joint_order(bits_of(samples.rows(rows), elements))


@dataclass(frozen=True, eq=False)
class InputChoices:
    """The elements and joints that recipes choose from rows of samples, such as a fold's training rows: once from each.

    ports, limits  costs and constraints, as for `select`
    ask            calls functions: in this process, or in workers, with a store
    """

    samples: Samples
    ports: PortCosts | None = None
    limits: Limits | None = None
    ask: Ask = lambda function, calls: [function(*args) for args in calls]
    _available: dict[tuple[int | None, bytes], Elements] = field(default_factory=dict, init=False, repr=False)
    _elements: dict[tuple[Recipe, float, bytes], Elements] = field(default_factory=dict, init=False, repr=False)
    _orders: dict[tuple[Elements, bytes], Columns] = field(default_factory=dict, init=False, repr=False)
    _sensors: dict[tuple[Recipe, int | None, bytes], InputSelection] = field(
        default_factory=dict, init=False, repr=False
    )

    @property
    def n_joints(self) -> int:
        """The number of joints."""
        return int(self.samples.codes.shape[1])

    def available(self, rows: Rows, levels: int | None) -> Elements:
        """Return the elements that there are to choose from in some rows."""
        place = levels, rows.tobytes()
        if place not in self._available:
            self._available[place] = elements_of(self.samples.rows(rows), levels)
        return self._available[place]

    def choose(self, recipes: Iterable[Recipe], several: Sequence[Rows]) -> None:
        """Choose the elements of recipes from several rows; what differs in the method's number alone, together."""
        numbers: dict[Recipe, dict[float, None]] = {}
        bought: dict[Recipe, dict[int | None, None]] = {}
        for recipe in recipes:
            if by_sensors(recipe):
                bought.setdefault(_bought(recipe), {})[recipe.sensors] = None
            elif recipe.inputs != "joints":
                same, number = _placement(recipe)
                numbers.setdefault(same, {})[number] = None
        # Costs that a method does not use are no reason to ask it again.
        used = {same for same in numbers if METHODS[same.placement].uses_ports or self.limits is not None}
        ports = {same: self.ports if same in used else None for same in numbers}
        places = [(same, rows, self.available(rows, same.levels)) for same in numbers for rows in several]
        calls = [
            (self.samples, rows, same, tuple(numbers[same]), elements, ports[same], self.limits)
            for same, rows, elements in places
        ]
        for (same, rows, _), path in zip(places, self.ask(choose_path, calls), strict=True):
            for number, elements in zip(numbers[same], path, strict=True):
                self._elements[same, number, rows.tobytes()] = elements
        wanted = [(same, rows) for same in bought for rows in several]
        asked = [(self.samples, rows, same, tuple(bought[same]), self.limits) for same, rows in wanted]
        for (same, rows), sets in zip(wanted, self.ask(choose_sensors, asked) if asked else (), strict=True):
            for count, (elements, joints) in zip(bought[same], sets, strict=True):
                self._sensors[same, count, rows.tobytes()] = InputSelection.of(elements, joints)

    def elements(self, recipe: Recipe, rows: Rows) -> Elements:
        """Return the elements that a recipe keeps by some rows."""
        if by_sensors(recipe):
            return self.sensors(recipe, rows).kept
        if recipe.inputs == "joints":
            return ()
        place = *_placement(recipe), rows.tobytes()
        if place not in self._elements:
            self.choose([recipe], [rows])
        return self._elements[place]

    def sensors(self, recipe: Recipe, rows: Rows) -> InputSelection:
        """Return the inputs of the sensors that a recipe chooses by some rows."""
        place = _bought(recipe), recipe.sensors, rows.tobytes()
        if place not in self._sensors:
            self.choose([recipe], [rows])
        return self._sensors[place]

    def rank(self, places: Sequence[tuple[Elements, Rows]]) -> None:
        """Rank the joints, given elements, by rows."""
        calls = [(self.samples, rows, elements) for elements, rows in places]
        for (elements, rows), order in zip(places, self.ask(rank_joints, calls), strict=True):
            self._orders[elements, rows.tobytes()] = order

    def joints(self, elements: Elements, rows: Rows, most: int | None) -> Columns:
        """Return the best joints, ascending, at most `most`, given these elements and rows; None: all."""
        if most is None or most >= self.n_joints:
            return tuple(range(self.n_joints))
        place = elements, rows.tobytes()
        if place not in self._orders:
            self.rank([(elements, rows)])
        return tuple(sorted(self._orders[place][:most]))


def _placement(recipe: Recipe) -> tuple[Recipe, float]:
    """Return all on which the choice of a recipe's elements depends, but for the number of its method; and that."""
    method = METHODS.named(recipe.placement)
    joints = recipe.inputs == "both" and (method.uses_joints or recipe.robust)
    inputs: Inputs = "both" if joints else "switches"
    same = Recipe(placement=recipe.placement, inputs=inputs, levels=recipe.levels, robust=recipe.robust)
    return same, float(recipe.keep or 0 if method.by_number else recipe.prune)


def _bought(recipe: Recipe) -> Recipe:
    """Return all on which the choice of a recipe's sensors depends, but for their number."""
    return Recipe(price=recipe.price, levels=recipe.levels)


def inner_folds(samples: Samples, seed: int, groups: NDArray[np.generic] | None = None) -> list[Fold]:
    """Return folds of training rows that split no movement, and no group if there are three or more.

    For a single group there are no folds.

    groups  (n,) the subject, object or session of each row, if those are left out
    """
    n_trials = len(np.unique(samples.movements))
    n_folds = next((folds for most, folds in _FOLDS if n_trials < most), 2)
    if groups is not None and len(np.unique(groups)) >= _LEAST_GROUPS:
        return leave_groups_out(groups, "group", n_folds)
    if n_trials < 2:
        return []
    return trial_folds(samples.labels, samples.movements, min(n_folds, n_trials), seed)


def choose_training(
    samples: Samples,
    candidates: Sequence[Training],
    *,
    seed: int = 1,
    groups: NDArray[np.generic] | None = None,
    of: Of = "within subject",
    jobs: int = 1,
    report: Callable[[int, int], None] | None = None,
) -> Fitting:
    """Choose the best of several ways to train for these rows, with the reason. A single candidate needs no folds.

    Parameters
    ----------
    samples : Samples
        The rows to learn from, of the kept switches and the joints.
    candidates : sequence of Training
        The candidates, as returned by `Training.candidates`: those of one trainer together, the most regular first.
    seed : int
        Seed for random inner folds.
    groups : ndarray, shape (n,), optional
        The subject, object or session of each row, if the fit is to generalise to new ones.
    of : str
        What is new about test rows, if there are `groups`.
    jobs : int
        Worker processes. The result does not depend on their number.
    report : callable, optional
        Called with (done, total) as the work proceeds.

    Returns
    -------
    Fitting
        Train with `Training.chosen(fitting)`.
    """
    # Of long movements, frames at even distances.
    rows = len(samples.labels)
    frames = rows // len(np.unique(samples.trials))
    some = np.arange(0, rows, max(1, min(frames // _FRAMES, -(-rows // _COMPARED))))
    samples, groups = samples.rows(some), None if groups is None else groups[some]
    folds = inner_folds(samples, seed, groups) if len(candidates) > 1 else []
    if not folds:
        return Fitting(candidates[0].trainer, _values(candidates[0]))
    grouped = groups is not None and len(np.unique(groups)) >= _LEAST_GROUPS
    clusters = groups if grouped and groups is not None else samples.movements
    tests: dict[tuple[int, str], _Test] = {}
    left = list(range(len(candidates)))
    for several in (folds[:1], folds[1:]):
        together = [list(batch) for _, batch in groupby(left, lambda one: _alike(candidates[one]))]
        tasks = [(samples, fold, [candidates[one] for one in batch], batch) for fold in several for batch in together]
        for name, batch, results in in_workers(_tested, tasks, jobs):
            tests |= {(one, name): test for one, test in zip(batch, results, strict=True)}
            if report is not None:
                stopped = len(candidates) - len(left)
                report(len(tests) + stopped * (len(folds) - 1), len(candidates) * len(folds) + 1)
        first = {one: tests[one, folds[0].name] for one in left}
        ahead = sorted(left, key=lambda one: first[one].loss)[:_AHEAD]
        left = sorted({*ahead, min(left, key=lambda one: first[one].rank)})
    scores = [_joined([tests[one, fold.name] for fold in folds]) for one in left]
    if not grouped:
        of = "pooled" if np.ptp(samples.subjects) else "within subject"
    finished = [candidates[one] for one in left]
    return replace(_fitting(finished, scores, clusters, samples.n_classes, of, len(folds)), tried=len(candidates))


def _values(training: Training) -> dict[str, float | None]:
    return {name: float(value) if isinstance(value, int) else value for name, value in training.settings.items()}


def _alike(training: Training) -> tuple[object, ...]:
    """Return the settings shared by trainings of which one gives the others: all but the rounds for staged trainers."""
    staged = TRAINERS.named(training.trainer).staged
    return training.trainer, *(
        (name, value) for name, value in training.settings.items() if name != "rounds" or not staged
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Test:
    """The result for the trials of a fold: the first rows (T,) of trials with a grasp, and whether each was recognised;
    the number of trials including those without a grasp, the sums of their losses with each factor, and the rows of its
    tables.
    """

    first: Rows
    hits: NDArray[np.bool_]
    trials: int
    losses: tuple[float, ...]
    rows: float

    @property
    def loss(self) -> float:
        """The mean loss with the best factor."""
        return round(min(self.losses) / self.trials, 6)

    @property
    def rank(self) -> tuple[int, float]:
        """Less for more trials that were recognised, then for a smaller loss."""
        return -int(self.hits.sum()), self.loss


def _joined(tests: list[_Test]) -> _Test:
    """Return the result over all inner folds, with the mean number of rows."""
    return _Test(
        np.concatenate([test.first for test in tests]),
        np.concatenate([test.hits for test in tests]),
        sum(test.trials for test in tests),
        tuple(map(fsum, zip(*(test.losses for test in tests), strict=True))),
        sum(test.rows for test in tests) / len(tests),
    )


def _tested(task: tuple[Samples, Fold, list[Training], list[int]]) -> tuple[str, list[int], list[_Test]]:
    samples, fold, trainings, batch = task
    learning, test = samples.rows(fold.train), samples.rows(fold.test)
    _, first, trial = np.unique(test.trials, return_index=True, return_inverse=True)
    weights, held = 1.0 / np.bincount(trial)[trial], ~test.is_none[first]
    if len(trainings) == 1:
        models: tuple[Model, ...] = (trainings[0].draft(learning),)
    else:
        rounds = [int(training.settings["rounds"] or 0) for training in trainings]
        models = trainings[int(np.argmax(rounds))].stages(learning, rounds)
    tests = []
    for model in models:
        scores = np.ascontiguousarray(model.scores(test.switches, test.codes).T)
        predicted = decided(scores.argmax(axis=0)[np.newaxis], trial)[0]
        losses = (softmax_and_loss(factor * scores, test.labels, weights)[1] for factor in _FACTORS)
        tests.append(
            _Test(
                fold.test[first[held]],
                (predicted == test.labels[first])[held],
                len(first),
                tuple(loss * len(first) for loss in losses),
                # The scores of the inputs in use: of each switch, bin, cell of a grid, and line.
                sum(term.n_rows for term in collapse(model, samples.n_switches).core_terms if term.largest > 0),
            )
        )
    return fold.name, batch, tests


def _error(gains: NDArray[np.intp], clusters: NDArray[np.generic]) -> float:
    """Return the standard error of the mean of integers (T,) in clusters, robust to correlation within them."""
    _, number, sizes = np.unique(clusters, return_inverse=True, return_counts=True)
    sums = np.zeros(len(sizes), np.int64)
    np.add.at(sums, number, gains)
    squares = int(((len(gains) * sums - sizes * int(gains.sum())) ** 2).sum())
    return round(sqrt(squares * len(sizes) / max(1, len(sizes) - 1)) / len(gains) ** 2, 6)


def _fitting(
    candidates: Sequence[Training],
    scores: list[_Test],
    clusters: NDArray[np.generic],
    n_classes: int,
    of: Of,
    n_folds: int,
) -> Fitting:
    # All candidates are tested on the same trials.
    clusters = clusters[scores[0].first]
    best = min(range(len(scores)), key=lambda one: scores[one].rank)
    compared = []
    for training, score in zip(candidates, scores, strict=True):
        gains = scores[best].hits.astype(np.intp) - score.hits
        compared.append(
            Compared(
                training.trainer,
                _values(training),
                correct=int(score.hits.sum()),
                total=len(score.hits),
                error=_error(score.hits.astype(np.intp), clusters),
                loss=score.loss,
                behind=round(int(gains.sum()) / len(gains), 6),
                behind_error=_error(gains, clusters),
                rows=score.rows,
            )
        )
    near = [number for number, other in enumerate(compared) if other.behind <= other.behind_error]
    small = max(_SMALL / n_classes, _LARGER * min(compared[number].rows for number in near))
    chosen = min(
        (number for number in near if compared[number].rows <= small),
        key=lambda number: (compared[number].loss, number),
    )
    # Of each trainer, the most accurate.
    shown = {
        other.trainer: number
        for number, other in sorted(enumerate(compared), key=lambda pair: (pair[1].correct, -pair[1].loss, -pair[0]))
    }
    return Fitting(
        candidates[chosen].trainer,
        _values(candidates[chosen]),
        of=of,
        folds=n_folds,
        compared=tuple(compared[number] for number in sorted({*shown.values(), chosen})),
        why=_why(compared, best, chosen),
    )


def _why(compared: list[Compared], best: int, chosen: int) -> str:
    top = compared[best]
    rate = f"{100 * compared[chosen].rate:.1f} % of {top.total} trials in inner folds"
    if chosen == best:
        return f"it has the highest accuracy, {rate}"
    return (
        f"its accuracy is {rate}, within one standard error of the best, {top.name}, with {100 * top.rate:.1f} %; of "
        "those with small tables it has the lowest log-loss"
    )
