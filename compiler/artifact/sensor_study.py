"""What sensors are worth: the accuracy with the best 1, 2, 3 ... of them, each chosen inside the training rows.

In every fold the sensors are chosen and the model is trained on the training rows alone. The sensors shown are those
that all rows choose. How often each of them is chosen in the folds, where people (or trials) are left out, says how
sure the choice is; its stand-in is the sensor that does nearly as well in its place.
"""

import textwrap
from collections.abc import Callable, Sequence
from functools import partial
from statistics import fmean
from typing import TYPE_CHECKING, Literal

import msgspec
import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from thenar.runtime.manifest import Of
from thenar.runtime.model.tables import winners
from thenar.runtime.names import shortened
from thenar.runtime.recipe import AUTO, Recipe

from ..evaluation.folds import EvaluationError, Fold, Rows
from ..evaluation.rates import Rate, RecipeWords, student
from ..hand import HandShape
from ..model.collapse import collapse
from ..pictures import FONT, WIDTH, around, on_paper, painting, rendered, write_beside
from ..placement.constraints import Limits
from ..placement.elements import Elements, bits_of, elements_of
from ..placement.methods.base import METHODS, PAPERS, by_sensors
from ..placement.placement import InputSelection
from ..placement.sensors import NEAR, USUAL, SensorSearch, SensorSet, read_by, search_of, sensor_names
from ..recogniser import Recogniser
from ..recordings.graspset import GraspSet
from ..samples import Columns, Samples, decided
from ..text import counted
from ..trainers.base import Report, Training
from ..wearer import STRENGTH
from ..wearer_study import Hits, hits_of
from ..workers import in_workers
from .training import Cut, cuts_of, samples_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Fits this model by default: it takes a tenth of the time of comparing trainers, and needs no setting.
TRAINER = "linear"
_LETTERS = 60  # of a line on the picture
OWN = 2  # trials of each type, after which the accuracy is measured again
# The next two sensors together are worth less than this where more of them stop to matter.
MATTERS = 0.01
# Called with the number of finished folds, that of all folds, and the accuracy for each number so far.
Rough = Callable[[int, int, dict[int, float]], None]
Classes = NDArray[np.intp]


class Worth(msgspec.Struct, frozen=True):
    """What a sensor adds to the accuracy, 0..1, paired over people or trials: the mean, and its 95 % interval."""

    mean: float
    low: float
    high: float

    @classmethod
    def of(cls, hits: NDArray[np.bool_], before: NDArray[np.bool_], clusters: NDArray[np.intp]) -> "Worth":
        """Return how much more often trials are correct in `hits` (m,) than `before` (m,), by clusters (m,)."""
        counts = np.bincount(clusters)
        gains = np.bincount(clusters, weights=hits.astype(np.float64) - before) / counts
        low, high = student(gains.tolist()) if len(gains) > 1 else (-1.0, 1.0)
        return cls(float(hits.mean() - before.mean()), round(low, 6), round(high, 6))

    def __str__(self) -> str:
        """Return "+2.1 [0.4, 3.8]", in points."""
        return f"{100 * self.mean:+.1f} [{100 * self.low:.1f}, {100 * self.high:.1f}]"


class SensorPoint(msgspec.Struct, frozen=True):
    """A number of sensors: those that all rows choose, and the accuracies, 0..1, with as many chosen in folds.

    sensors            names, in the order in which they were added
    added, removed     the difference to the sensors of the number before
    mean, low, high    the accuracy of trials, and its 95 % interval
    worth              the gain over the number before; None for the first
    adapted            the mean over people after OWN trials of each type; None if nobody has more
    papers             the accuracy with as many switches and pads by the paper's ID3 alone; None without these
    """

    number: int
    sensors: tuple[str, ...]
    added: tuple[str, ...]
    removed: tuple[str, ...]
    mean: float
    low: float
    high: float
    worth: Worth | None = None
    adapted: float | None = None
    papers: float | None = None


class SensorRow(msgspec.Struct, frozen=True):
    """A chosen sensor: what it is, the folds that choose it, too, its price, and what could stand in for it.

    rise  the share by which the loss of the search rises with the stand-in in its place
    """

    name: str
    kind: Literal["switch", "pad", "joint"]
    folds: int
    price: float | None = None
    stand_in: str = ""
    rise: float | None = None


class SensorStudy(msgspec.Struct, frozen=True):
    """The result: a point for each number of sensors, and the sensors of the number asked for, or of `enough`.

    of             what the accuracy is of; folds: the number of folds
    enough         the number after which more stop to matter
    left_out       the names of the other sensors
    """

    recipe: RecipeWords
    of: Of
    folds: int
    trials: int
    enough: int
    points: tuple[SensorPoint, ...]
    chosen: tuple[SensorRow, ...]
    left_out: tuple[str, ...]

    @property
    def point(self) -> SensorPoint:
        """The point of the chosen sensors."""
        return next(point for point in self.points if len(point.sensors) == len(self.chosen))

    @property
    def there(self) -> int:
        """The number of sensors in the set."""
        return len(self.chosen) + len(self.left_out)

    @property
    def alike(self) -> tuple[SensorRow, ...]:
        """The chosen sensors whose stand-in is worth nearly as much."""
        return tuple(row for row in self.chosen if row.rise is not None and row.rise <= NEAR)

    @property
    def price(self) -> float | None:
        """The price of the chosen sensors together; None without prices."""
        prices = [row.price for row in self.chosen if row.price is not None]
        return sum(prices) if len(prices) == len(self.chosen) else None


def study_sensors(
    grasp_set: GraspSet,
    recipe: Recipe,
    *,
    limits: Limits | None = None,
    jobs: int = -1,
    report: Report | None = None,
    rough: Rough | None = None,
) -> SensorStudy:
    """Measure what sensors are worth.

    Parameters
    ----------
    grasp_set : GraspSet
        The recordings. With several subjects each is left out in turn, otherwise trials.
    recipe : Recipe
        `sensors` or `price` to measure only that choice, neither for the curve of 1 to 16 sensors. A trainer, otherwise
        "linear"; the folds, and what they leave out.
    limits : Limits, optional
        The sensors to keep or to leave out, and prices.
    jobs : int
        Worker processes; the result does not depend on their number.
    report, rough : callable, optional
        Called as the work proceeds: with (done, total), and after each fold with the accuracies so far.

    Raises
    ------
    CompileError, EvaluationError, TrainingError
        If the recordings do not allow it, or no sensor varies.
    """
    grasp_set = grasp_set.without_none()
    samples = samples_of(grasp_set, recipe)
    cuts = cuts_of(grasp_set, recipe)
    if not cuts:
        raise EvaluationError("``folds`` 0: the worth of sensors is measured in folds, of which 2 or more are needed")
    cut = cuts[0]
    names = sensor_names(samples, grasp_set.element_names, grasp_set.joint_names)
    training = Training.of(replace(recipe, trainer=TRAINER) if recipe.trainer == AUTO else recipe)
    folds, sets = dict[int, _Found](), dict[int, SensorSet]()
    # The search among all rows takes as long as a fold, and a rough curve does without.
    tasks = (0, 1, None, *range(2, len(cut.folds)))
    task = partial(_task, samples, recipe, training, limits, cut.folds)
    for done, found in enumerate(in_workers(task, tasks, jobs), 1):
        if isinstance(found, _Found):
            folds[found.fold] = found
            if rough is not None:
                rough(len(folds), len(cut.folds), _rates(samples, [*folds.values()]))
        else:
            sets = found
        if report is not None:
            report(done, len(tasks))
    if not sets:
        raise EvaluationError("no sensor differs between rows: nothing distinguishes the grasp types")
    several, one = [folds[number] for number in range(len(cut.folds))], by_sensors(recipe)
    search = search_of(samples, limits)
    points = _points(samples, cut, several, sets, names)
    enough = _enough(points)
    rows = sets[max(sets) if one else enough]
    words = RecipeWords.of(replace(recipe, trainer=training.trainer))
    return SensorStudy(
        recipe=words if one else RecipeWords("the best sensors of each number", words.trainer),
        of=cut.of,
        folds=len(cut.folds),
        trials=len(np.unique(samples.trials)),
        enough=enough,
        points=points,
        chosen=_rows(search, rows, [found.sensors[found.nearest(len(rows.sensors))] for found in several], names),
        left_out=tuple(name for number, name in enumerate(names) if number not in rows.sensors),
    )


def _rows(
    search: SensorSearch, chosen: SensorSet, in_folds: Sequence[Columns], names: Sequence[str]
) -> tuple[SensorRow, ...]:
    """Return the rows of the chosen sensors, given those that each fold chooses."""
    # Of many sensors, stand-ins would take long, and nobody would read them.
    few = len(chosen.sensors) <= 2 * USUAL
    stand_ins = search.stand_ins(chosen) if few else (None,) * len(chosen.sensors)
    return tuple(
        SensorRow(
            names[sensor],
            _kind(search.samples, sensor),
            sum(sensor in sensors for sensors in in_folds),
            None if search.prices is None else float(search.prices[sensor]),
            "" if other is None else names[other.sensors[-1]],
            None if other is None else round(other.loss / chosen.loss - 1.0, 4),
        )
        for sensor, other in zip(chosen.sensors, stand_ins, strict=True)
    )


def _kind(samples: Samples, sensor: int) -> Literal["switch", "pad", "joint"]:
    if sensor < samples.n_switches:
        return "switch"
    return "pad" if sensor < samples.n_switches + samples.taxels.shape[1] else "joint"


def _sets(search: SensorSearch, recipe: Recipe) -> dict[int, SensorSet]:
    """Return the best sensors by their number: of the one that the recipe asks for, or of all."""
    sets = [search.chosen(recipe.sensors)] if by_sensors(recipe) else search.sets(max(USUAL, len(search.have))).values()
    return {len(each.sensors): each for each in sets if each.sensors}


class _Found(msgspec.Struct):
    """What a fold, by its number, finds for its rows `test` with each number of sensors, from none on: the sensors, the
    classes (2, n_test) by them and by the paper's switches, and what own trials of people bring.
    """

    fold: int
    test: Rows
    sensors: dict[int, Columns]
    predicted: dict[int, Classes]
    adapted: dict[int, list[Hits]]

    def nearest(self, number: int) -> int:
        """Return the number, or the most sensors that the fold has."""
        return number if number in self.sensors else max(self.sensors)


def _task(
    samples: Samples,
    recipe: Recipe,
    training: Training,
    limits: Limits | None,
    folds: Sequence[Fold],
    fold: int | None,
) -> "_Found | dict[int, SensorSet]":
    """Return the result of a fold by its number; None: the best sensors by all rows."""
    if fold is None:
        return _sets(search_of(samples, limits), recipe)
    test = folds[fold].test
    learnt, tested = samples.rows(folds[fold].train), samples.rows(test)
    elements = elements_of(learnt, recipe.levels)
    papers = _papers(learnt, elements)
    # Of rows that no sensor distinguishes, the most frequent type is predicted.
    usual = np.full((2, len(test)), learnt.most_frequent)
    found = _Found(fold, test, {0: ()}, {0: usual}, {0: []})
    for number, best in _sets(search_of(learnt, limits), recipe).items():
        found.sensors[number], found.predicted[number] = best.sensors, usual.copy()
        selection = InputSelection(elements, *read_by(learnt, elements, best.sensors))
        recogniser = _trained(learnt, recipe, training, selection)
        found.predicted[number][0] = _classes(recogniser, tested)
        found.adapted[number] = hits_of(recogniser, tested, ((OWN, STRENGTH),))
        if papers is not None and (selection := papers(number)).columns:
            found.predicted[number][1] = _classes(_trained(learnt, recipe, training, selection), tested)
    return found


def _rates(samples: Samples, several: Sequence[_Found]) -> dict[int, float]:
    """Return the accuracy of rows for each number of sensors, by the folds so far."""
    truth = np.concatenate([samples.labels[found.test] for found in several])
    rates = {}
    for number in filter(None, several[0].sensors):
        predicted = np.concatenate([found.predicted[found.nearest(number)][0] for found in several])
        rates[number] = float((predicted == truth).mean())
    return rates


def _trained(learnt: Samples, recipe: Recipe, training: Training, selection: InputSelection) -> Recogniser:
    model = training.draft(selection.read(learnt))
    return Recogniser(recipe, learnt, selection, model, training=training)


def _classes(recogniser: Recogniser, tested: Samples) -> Classes:
    read = recogniser.read(tested)
    return winners(collapse(recogniser.model, read.n_switches).scores(read.switches, read.codes))


def _papers(learnt: Samples, elements: Elements) -> Callable[[int], InputSelection] | None:
    """Return the paper's placement with at most a number of switches and pads: ID3 with the least S that has so few."""
    if not learnt.n_switches + learnt.taxels.shape[1]:
        return None
    choose = METHODS[PAPERS].chooser(bits_of(learnt, elements))
    n = len(learnt.labels)

    def kept(most: int) -> InputSelection:
        low, high = 0, n + 1
        while low < high:
            middle = (low + high) // 2
            few = len({elements[column].column for column in choose(middle)}) <= most
            low, high = (low, middle) if few else (middle + 1, high)
        return InputSelection(elements, choose(low), ())

    return kept


def _points(
    samples: Samples,
    cut: Cut,
    several: Sequence[_Found],
    sets: dict[int, SensorSet],
    names: Sequence[str],
) -> tuple[SensorPoint, ...]:
    _, first, trial = np.unique(samples.trials, return_index=True, return_inverse=True)
    truth = samples.labels[first]
    clusters = np.arange(len(first)) if cut.groups is None else np.unique(cut.groups[first], return_inverse=True)[1]
    points, before, previous = list[SensorPoint](), None, tuple[str, ...]()
    paper = (samples.n_switches + samples.taxels.shape[1]) > 0
    for number in sets:
        predicted = np.empty((2, len(samples.labels)), np.intp)
        for found in several:
            predicted[:, found.test] = found.predicted[found.nearest(number)]
        people = [hits for found in several for hits in found.adapted[found.nearest(number)]]
        rate = Rate.predicted(predicted[0], samples.labels, samples.trials, of=cut.of, groups=cut.groups)
        hits, by_paper = (decided(each[np.newaxis], trial)[0] == truth for each in predicted)
        sensors = tuple(names[sensor] for sensor in sets[number].sensors)
        points.append(
            SensorPoint(
                number=number,
                sensors=sensors,
                added=tuple(name for name in sensors if name not in previous),
                removed=tuple(name for name in previous if name not in sensors),
                mean=rate.mean,
                low=round(rate.low, 6),
                high=round(rate.high, 6),
                worth=None if before is None else Worth.of(hits, before, clusters),
                adapted=fmean(correct[0] / total for correct, total in people) if people else None,
                papers=float(by_paper.mean()) if paper else None,
            )
        )
        before, previous = hits, sensors
    return tuple(points)


def _enough(points: Sequence[SensorPoint]) -> int:
    """Return the number of sensors after which the next two together are worth less than MATTERS."""
    means = [point.mean for point in points]
    for place, point in enumerate(points):
        if max(means[place + 1 : place + 3], default=0.0) < means[place] + MATTERS:
            return point.number
    return points[-1].number


def number_without(grasp_set: GraspSet, recipe: Recipe, drop: int) -> int:
    """Return how many sensors are left without `drop` of them. Raises EvaluationError if none are."""
    samples = samples_of(grasp_set.without_none(), recipe)
    there = len(sensor_names(samples, grasp_set.element_names, grasp_set.joint_names)) - len(recipe.never)
    if drop >= there:
        raise EvaluationError(f"``drop`` {drop}: there are {counted(there, 'sensor')}, and one has to be left")
    return there - drop


def without_one(grasp_set: GraspSet, recipe: Recipe, limits: Limits | None, name: str) -> Recipe:
    """Return the recipe that keeps the other chosen sensors, and the best one in place of `name`.

    Without `sensors` and `price`, those of `have` are the chosen ones. Raises EvaluationError if `name` is not one.
    """
    samples = samples_of(grasp_set.without_none(), recipe)
    names = sensor_names(samples, grasp_set.element_names, grasp_set.joint_names)
    chosen = recipe.have
    if by_sensors(recipe):
        chosen = tuple(names[sensor] for sensor in search_of(samples, limits).chosen(recipe.sensors).sensors)
    if name not in chosen:
        raise EvaluationError(
            f"{name} is not among the chosen sensors {shortened(', '.join(chosen))}: there is nothing to replace"
        )
    rest = tuple(other for other in chosen if other != name)
    return replace(recipe, have=rest, never=(*recipe.never, name), sensors=len(chosen), price=None)


def draw_curve(study: SensorStudy, hand: HandShape | None, kind: str) -> bytes:
    """Return the picture of a study as the bytes of a "png" or "svg": the accuracies, and on a hand whose positions are
    known the chosen sensors, numbered, each as large as the share of the folds that choose it.

    Raises PictureError for another kind, or without matplotlib.
    """
    with painting(FONT):
        from matplotlib.figure import Figure
        from matplotlib.ticker import MaxNLocator

        figure = Figure(
            figsize=(WIDTH, 10 if hand else 4.5), layout="constrained", dpi=120, facecolor=on_paper("paper")
        )
        ratios = [3, 4] if hand else [1]
        axes, *others = figure.subplots(len(ratios), squeeze=False, height_ratios=ratios)[:, 0]
        numbers = [point.number for point in study.points]
        means = [100 * point.mean for point in study.points]
        reach = [[100 * (p.mean - p.low) for p in study.points], [100 * (p.high - p.mean) for p in study.points]]
        axes.errorbar(
            numbers, means, reach, marker="o", capsize=2, color=on_paper("both"), label=f"{study.of}, 95 % interval"
        )
        for values, label, colour in (
            ([point.adapted for point in study.points], f"after {OWN} own trials of each type", "joints"),
            ([point.papers for point in study.points], "as many switches and pads by the paper's ID3", "baseline-3"),
        ):
            shown = [100 * value for value in values if value is not None]
            if len(shown) == len(numbers):
                axes.plot(numbers, shown, marker=".", linestyle="--", color=on_paper(colour), label=label)
        axes.axvline(study.enough, color=on_paper("line"), zorder=0)
        axes.xaxis.set_major_locator(MaxNLocator(8, integer=True))
        axes.set(xlabel=f"sensors kept of {study.there}", ylabel="accuracy, %", ylim=(0, 100))
        axes.legend(loc="lower left", bbox_to_anchor=(0, 1), frameon=False)  # above, where no interval is
        for panel in others:
            _draw_hand(panel, hand, study)
        return rendered(figure, kind)


def _draw_hand(axes: "Axes", hand: HandShape | None, study: SensorStudy) -> None:
    assert hand is not None
    axes.set_aspect("equal")
    axes.axis("off")
    if len(hand.outline):
        axes.plot(*hand.outline.T, color=on_paper("outline"), linewidth=0.8)
    every = hand.places.T
    axes.scatter(every[0], every[1], s=14, facecolors="none", edgecolors=on_paper("crease"), linewidths=0.7)
    off, labels = [], []
    for number, row in enumerate(study.chosen, 1):
        if not hand.knows([row.name]):
            off.append(f"{number} {row.name}")
            continue
        ((x, y),) = hand.places[hand.numbers_of([row.name])].tolist()
        axes.scatter(x, y, s=30 + 60 * row.folds / study.folds, color=on_paper("kept"), zorder=2)
        labels.append((x, y, str(number)))
    if off:
        axes.set_title(textwrap.fill("joints: " + ", ".join(off), _LETTERS), fontsize=FONT)
    figure = axes.get_figure(root=True)
    assert figure is not None
    figure.draw_without_rendering()  # which settles where the axes are
    write_beside(axes, labels, [around(axes, x, y) for x, y, _ in labels])
