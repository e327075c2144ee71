"""A standard placement: one for many subjects, its accuracy for the worst-served tenth, and the subjects it needs.

Placements are trained on some subjects and tested on others. Three are compared: as a method chooses them, and refined
for the mean over subjects or for the worst-served tenth. The choice among the three is made within the training
subjects, on a fifth of them that is held out, by the mean and the worst tenth in equal parts.

A method can hardly distinguish its last choices from the next candidates: another draw of rows ranks them differently.
So these are exchanged, one by one, as long as the model of one half of the subjects then reaches a higher accuracy on
the other half: on the mean over subjects, or on the worst tenth. Weights instead of exchanges (more weight for the
worst tenth, or for every subject by its error) gained no more than another draw of rows did.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..boosting.boost import boost
from ..boosting.stumps import winners
from ..recordings.graspset import GraspSet
from ..samples import Samples, decided
from ..workers import in_workers
from .elements import Element, Elements, bits_of, elements_of, names_of
from .inputs import PlacementError
from .methods.base import BEST, METHODS
from .placement import Aim, CurvePoint, Placement, Progress, Served, Standard, kept_of, samples_of

Numbers = NDArray[np.intp]

AIMS: tuple[Aim, ...] = ("plain", "mean", "worst tenth")

LEAST_SUBJECTS = 8
WORST_SHARE = 0.1
_HELD_OUT = 0.2
_SIZES = (2, 5, 10, 20, 40, 80, 160)
# Numbers of last choices and next candidates that may be exchanged, and of exchanges, at most.
REACH, EXCHANGES = 4, 2
# With fewer subjects nothing is exchanged: the worst tenth is then a handful, and with 10 to 40 of the 200 subjects,
# gains of exchanges within them were more often than not losses on others.
ENOUGH_SUBJECTS = 80
_TEST_ROWS = 50


@dataclass(frozen=True, slots=True)
class StudyOptions:
    """Parameters of a study of a population.

    keep     switches to keep; method: one of `METHODS` whose parameter is a number of switches
    rows     most rows to place with, equally many of every subject; classifiers are trained on all rows
    rounds   of LogitBoost that evaluates a placement
    repeats  draws of subjects for every point of the learning curve
    """

    keep: int
    method: str = BEST
    rows: int = 3000
    rounds: int = 40
    repeats: int = 2
    seed: int = 1


@dataclass(frozen=True, slots=True, eq=False)
class Population:
    """Rows of many subjects: `samples` of n rows, and the subject of each row, subjects (n,) intp."""

    samples: Samples
    subjects: Numbers

    def of(self, subjects: Numbers) -> "Population":
        """Return the rows of some subjects."""
        return self._part(np.flatnonzero(np.isin(self.subjects, subjects)))

    def drawn(self, rows: int, seed: int) -> "Population":
        """Return about `rows` rows, about equally many of every subject, in whole trials drawn with `seed`; all rows
        if there are no more.
        """
        there = np.unique(self.subjects)
        if rows >= len(self.subjects):
            return self
        each = max(rows // len(there), 1)
        random = np.random.default_rng(seed)
        own = (self._trials_of(subject, each, random) for subject in there)
        return self._part(np.flatnonzero(np.isin(self.samples.trials, np.concatenate(list(own)))))

    def _trials_of(self, subject: int, rows: int, random: np.random.Generator) -> Numbers:
        """Return random trials of a subject, by number: one, or as many as have at most `rows` rows."""
        trials, frames = np.unique(self.samples.trials[self.subjects == subject], return_counts=True)
        order = random.permutation(len(trials))
        return np.asarray(trials[order[: max(int(np.searchsorted(np.cumsum(frames[order]), rows, "right")), 1)]])

    def _part(self, rows: Numbers) -> "Population":
        return replace(self, samples=self.samples.rows(rows), subjects=self.subjects[rows])


def rates(train: Population, test: Population, elements: Elements, rounds: int) -> NDArray[np.float64]:
    """Return the accuracy, by trials, of every subject of `test`, in the order of their numbers.

    LogitBoost of `rounds` rounds is trained on the elements, and any joints, of `train`.
    """
    samples, others = (bits_of(population.samples, elements) for population in (train, test))
    stumps, _ = boost(samples.inputs, samples.labels, samples.n_classes, rounds=rounds)
    _, first, trial = np.unique(test.samples.trials, return_index=True, return_inverse=True)
    found = decided(winners(stumps.scores(others.inputs))[np.newaxis], trial)[0]
    numbers = np.unique(test.subjects[first], return_inverse=True)[1]
    right = found == test.samples.labels[first]
    return np.asarray(np.bincount(numbers, right) / np.bincount(numbers), dtype=np.float64)


def served(rates: NDArray[np.float64]) -> Served:
    """Return the mean, worst tenth and lowest of these accuracies (n,) of subjects."""
    ordered = np.sort(rates)
    worst = ordered[: max(round(WORST_SHARE * len(ordered)), 1)]
    return Served(float(rates.mean()), float(worst.mean()), float(ordered[0]))


@dataclass(slots=True)
class Refining:
    """Refine a placement: exchange elements of `kept`, a method's choice, for `spare`, those that it ranks next.

    LogitBoost of `rounds` rounds, trained on `rows` rows of `population`, judges each exchange.
    """

    population: Population
    kept: Elements
    spare: Elements
    rows: int
    rounds: int
    seed: int
    _halves: tuple[tuple[Population, Population], ...] = field(init=False)
    _known: dict[frozenset[Element], NDArray[np.float64]] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        people = np.random.default_rng([self.seed, 2]).permutation(np.unique(self.population.subjects))
        one, other = self.population.of(people[::2]), self.population.of(people[1::2])
        train = [half.drawn(self.rows // 2, self.seed) for half in (one, other)]
        test = [half.drawn(_TEST_ROWS * len(np.unique(half.subjects)), self.seed) for half in (other, one)]
        self._halves = tuple(zip(train, test, strict=True))

    def best(self, aim: Aim) -> Elements:
        """Return the method's placement ("plain"), or the placement after the exchanges that improve `aim` most.

        No exchange is made without a gain, nor with fewer than ENOUGH_SUBJECTS.
        """
        if aim == "plain" or len(np.unique(self.population.subjects)) < ENOUGH_SUBJECTS:
            return self.kept
        elements = self.kept
        for _ in range(EXCHANGES):
            better = max([elements, *self._exchanges(elements)], key=lambda tried: self._value(tried, aim))
            if better == elements:
                break
            elements = better
        return elements

    def _exchanges(self, elements: Elements) -> list[Elements]:
        edge = (*self.kept[-REACH:], *self.spare)
        return [
            tuple(new if element == old else element for element in elements)
            for old in elements
            if old in edge
            for new in edge
            if new not in elements
        ]

    def _value(self, elements: Elements, aim: Aim) -> float:
        key = frozenset(elements)
        if key not in self._known:
            order = tuple(sorted(elements))
            parts = [rates(train, test, order, self.rounds) for train, test in self._halves]
            self._known[key] = np.concatenate(parts)
        found = served(self._known[key])
        return found.worst_tenth if aim == "worst tenth" else found.mean


@dataclass(frozen=True, slots=True, eq=False)
class _Task:
    """Train on some subjects of a population, test on others."""

    population: Population
    train: Numbers
    test: Numbers
    options: StudyOptions
    seed: int
    place: int


def place_for_population(
    grasp_set: GraspSet,
    keep: int,
    *,
    method: str = BEST,
    joints: bool = False,
    jobs: int = -1,
    on_done: Progress | None = None,
) -> Placement:
    """Choose at most `keep` switches for all subjects of a set; the placement's `study` has their accuracies.

    Raises PlacementError as `place` does, and for fewer than eight subjects; MemberError for an unknown method.
    """
    fingerprint, grasp_set = grasp_set.fingerprint(), grasp_set.without_none()
    samples = samples_of(grasp_set, joints=joints)
    population = Population(samples, np.unique(grasp_set.subjects, return_inverse=True)[1])
    study = standard_placement(population, StudyOptions(keep, method), jobs, on_done)
    return Placement(
        method=method,
        parameter=float(keep),
        joints=joints,
        switches=kept_of(grasp_set, study.elements, tuple(range(len(study.elements)))),
        rows=len(grasp_set),
        fingerprint=fingerprint,
        all_names=names_of(grasp_set, elements_of(samples)),
        n_switches=len(grasp_set.switch_names),
        n_taxels=len(grasp_set.taxel_columns),
        n_joints=len(grasp_set.joints),
        grasps=samples.grasps,
        study=study,
    )


def standard_placement(
    population: Population, options: StudyOptions, jobs: int = 1, on_done: Progress | None = None
) -> Standard:
    """Return one placement for all subjects of `population`, and the accuracy against the number of training subjects.

    `on_done(done, all)` is called after every task. The same arguments give the same result, whatever `jobs`.
    Raises PlacementError for fewer than eight subjects, and for a method that takes no number of switches.
    """
    if not METHODS.named(options.method).by_number:
        raise PlacementError(f"{options.method} takes S: a standard placement takes a method of a number of switches")
    people = np.unique(population.subjects)
    if len(people) < LEAST_SUBJECTS:
        raise PlacementError(
            f"the set has {len(people)} subject(s): a standard placement needs at least {LEAST_SUBJECTS}"
        )
    people = np.random.default_rng(options.seed).permutation(people)
    test, train = _apart(people)
    tasks = [_trial(population, train, options), *_curve(population, train, test, options)]
    found: dict[int, tuple[Served, ...]] = {}
    for done, (place, result) in enumerate(in_workers(_work, tasks, jobs), 1):
        found[place] = result
        if on_done is not None:
            on_done(done, len(tasks) + 1)
    points = _points(tasks, found)
    tried, curve = points[: len(AIMS)], points[len(AIMS) :]
    aim = max(tried, key=lambda point: point.served.worth).aim
    elements = _refining(population, options, options.seed).best(aim)
    if on_done is not None:
        on_done(len(tasks) + 1, len(tasks) + 1)
    rows = len(population.drawn(options.rows, options.seed).subjects)
    return Standard(elements, options.method, aim, len(people), len(test), rows, tried, curve)


def _apart(people: Numbers) -> tuple[Numbers, Numbers]:
    """Return a fifth of the people, to test on, and the others, to train on."""
    held_out = max(round(_HELD_OUT * len(people)), 1)
    return people[:held_out], people[held_out:]


def _trial(population: Population, train: Numbers, options: StudyOptions) -> _Task:
    """Return the task that compares the aims, within the training subjects."""
    test, rest = _apart(train)
    return _Task(population.of(train), rest, test, options, options.seed, 0)


def _curve(population: Population, train: Numbers, test: Numbers, options: StudyOptions) -> list[_Task]:
    """Return the tasks of the learning curve: numbers of subjects, draws of them."""
    sizes = [*(size for size in _SIZES if size < len(train)), len(train)]
    tasks: list[_Task] = []
    for size in sizes:
        draws = options.repeats if size < len(train) else 1
        for seed in range(options.seed, options.seed + draws):
            some = np.random.default_rng([seed, size]).permutation(train)[:size]
            tasks.append(_Task(population.of(np.append(some, test)), some, test, options, seed, len(tasks) + 1))
    return tasks


def _work(task: _Task) -> tuple[int, tuple[Served, ...]]:
    """Return the task's number, and the accuracies of the test subjects for each aim."""
    train, test = task.population.of(task.train), task.population.of(task.test)
    refining = _refining(train, task.options, task.seed)
    placements = [refining.best(aim) for aim in AIMS]
    found = {elements: served(rates(train, test, elements, task.options.rounds)) for elements in placements}
    return task.place, tuple(found[elements] for elements in placements)


def _refining(population: Population, options: StudyOptions, seed: int) -> Refining:
    """Return the method's placement, from rows drawn evenly over the subjects, ready for refinement."""
    samples = population.drawn(options.rows, seed).samples
    elements = elements_of(samples)
    choose = METHODS.named(options.method).chooser(bits_of(samples, elements))
    kept, more = (tuple(elements[column] for column in choose(size)) for size in (options.keep, options.keep + REACH))
    spare = tuple(element for element in more if element not in kept)
    return Refining(population, kept, spare, options.rows, options.rounds, seed)


def _points(tasks: list[_Task], found: dict[int, tuple[Served, ...]]) -> tuple[CurvePoint, ...]:
    """Return the means over the draws for every aim, those of the trial first."""
    draws: dict[tuple[bool, int], list[tuple[Served, ...]]] = {}
    for task in tasks:
        draws.setdefault((task.place == 0, len(task.train)), []).append(found[task.place])
    return tuple(
        CurvePoint(size, aim, _mean([one[number] for one in several]))
        for (_, size), several in draws.items()
        for number, aim in enumerate(AIMS)
    )


def _mean(several: list[Served]) -> Served:
    """Return the mean of every rate."""
    fields = np.array([(one.mean, one.worst_tenth, one.lowest) for one in several]).mean(axis=0)
    return Served(*fields.tolist())
