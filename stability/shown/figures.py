"""The pictures of the page, with captions, from measurements on all cores."""

import itertools
import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.compiler.boosting.boost import boost
from thenar.compiler.boosting.stumps import winners
from thenar.compiler.elementary import Floats
from thenar.compiler.pictures import painting, rendered
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.tables.collapse import collapse
from thenar.compiler.tables.quantise import quantise
from thenar.compiler.tables.worstcase import Rounding
from thenar.compiler.workers import in_workers
from thenar.runtime.scores import Scorer

from ..checks.integer_sums import first_best
from ..checks.rounds import mean_score, moments
from ..inputs.hard_data import HardSet, noisy, separable
from ..inputs.small_sets import small_set
from ..report import figure as worded
from ..report import weka_lines
from ..weka import DIVERGED, Comparison, NotRun
from .page import Picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FONT = 9.5

# Okabe and Ito's colour-blind safe colours.
BLUE, ORANGE, RED, GREEN, GREY = "#0072B2", "#E69F00", "#D55E00", "#009E73", "#666666"

_WIDTH = 8.6  # inches
_APART = 1.03  # smallest ratio of two rounds on a logarithmic axis
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def sheet(rows: int, columns: int, height: float) -> tuple["Figure", list[list["Axes"]]]:
    """Return a figure of rows x columns axes, `height` inches high."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDTH, height), layout="constrained", dpi=120)
    return figure, [list(row) for row in figure.subplots(rows, columns, squeeze=False)]


def head(axes: "Axes", title: str) -> None:
    """Set a title above the axes: quantity and unit."""
    axes.set_title(title, fontsize=FONT, loc="left")


def band(axes: "Axes", least: Sequence[float], greatest: Sequence[float], colour: str) -> None:
    """Fill the area between two curves."""
    rounds, low = curve(axes, least, colour, pick=min)
    _, high = curve(axes, greatest, colour)
    axes.fill_between(rounds, low, high, color=colour, alpha=0.15, lw=0)


def curve(
    axes: "Axes",
    heights: Sequence[float],
    colour: str,
    label: str | None = None,
    pick: Callable[[Sequence[float]], float] = max,
) -> tuple[list[int], list[float]]:
    """Draw the positive heights after each round, and return the drawn rounds and heights.

    Rounds too close on a logarithmic axis are merged to one point, with the height chosen by `pick`.
    """
    last, rounds = len(heights), [1]
    while rounds[-1] <= last:
        rounds.append(max(rounds[-1] + 1, int(rounds[-1] * _APART)))
    near = ([h for h in heights[first - 1 : after - 1] if h > 0] for first, after in itertools.pairwise(rounds))
    shown = [pick(some) if some else math.nan for some in near]
    axes.plot(rounds[:-1], shown, color=colour, lw=1.6, label=label)
    ticks = [10**power for power in range(len(str(last)))]
    axes.set(xscale="log", xlim=(1, last))
    axes.set_xticks(ticks, [f"{tick:,}" for tick in ticks])
    return rounds[:-1], shown


def exponents(axes: "Axes") -> range:
    """Return the exponents of at most seven powers of ten that enclose all drawn positive values."""
    heights = [height for line in axes.lines for height in np.asarray(line.get_ydata(), np.float64).tolist()]
    parts = [f"{height:e}".split("e") for height in heights if height > 0] or [["1", "0"]]
    low = min(int(power) for _, power in parts)
    high = max(int(power) + (float(digits) > 1) for digits, power in parts)
    step = max(1, math.ceil((high - low) / 6))
    return range(high - step * max(1, math.ceil((high - low) / step)), high + 1, step)


def powers(axes: "Axes", ticks: range) -> None:
    """Make the vertical axis logarithmic, between powers of ten with these exponents."""
    axes.set_yscale("log")
    labels = ["1" if exponent == 0 else "10" + str(exponent).translate(_RAISED) for exponent in ticks]
    axes.set_yticks([10.0**exponent for exponent in ticks], labels)
    axes.set_ylim(10.0 ** ticks[0], 10.0 ** ticks[-1])
    axes.minorticks_off()
    axes.grid(axis="y", color="#dddddd", lw=0.6)
    axes.set_axisbelow(True)


def rule(axes: "Axes", height: float, right: float, text: str) -> None:
    """Draw a dotted horizontal line, with its meaning under its right end."""
    axes.axhline(height, color=GREY, lw=1, ls=":")
    note = axes.annotate(text, (right, height), (0, -3), textcoords="offset points", ha="right", va="top", color=GREY)
    note.set_bbox({"facecolor": "white", "edgecolor": "none", "pad": 1})


_NOTHING = 1e-17  # the position of a difference of exactly 0 on a logarithmic axis


def draw_ranges(trainings: Sequence["Ranges"], kind: str = "svg") -> bytes:
    """Draw for one or two trainings least and greatest probability and weight, loss, and drift of the scores."""
    with painting(FONT):
        figure, ((shares, weights), (losses, drifts)) = sheet(2, 2, 5.6)
        for ranges, colour in zip(trainings, (BLUE, RED), strict=False):
            band(shares, ranges.least_probability, ranges.greatest_probability, colour)
            band(weights, ranges.least_weight, ranges.greatest_weight, colour)
            curve(losses, ranges.losses, colour)
            curve(drifts, ranges.mean_scores, colour, ranges.name)
        head(shares, "probability of a class, least and greatest")
        head(weights, "weight of a row, least above 0 and greatest")
        head(losses, "mean loss, nats")
        head(drifts, "|mean score| of a row, the largest, units of score")
        for axes in (shares, weights, losses, drifts):
            powers(axes, exponents(axes))
            axes.set_xlabel("round of boosting")
        figure.legend(frameon=False, loc="outside upper left", ncols=2)
        return rendered(figure, kind)


def draw_weka(weka: Comparison, kind: str = "svg") -> bytes:
    """Draw the differences of the held-out distributions of thenar and of Weka with two exp(), after each round."""
    with painting(FONT):
        figure, ((axes,),) = sheet(1, 1, 4.1)
        lines = (
            (weka.weka_itself, RED, "-", "Weka with the JVM's two exp() settings"),
            (weka.ours_processor, ORANGE, "--", "thenar and Weka with the processor's exp(), the default"),
            (weka.ours_java, BLUE, "-", "thenar and Weka with Java's portable exp()"),
        )
        for differences, colour, style, label in lines:
            heights = [max(height, _NOTHING) for height in differences.largest]
            axes.plot(range(1, weka.rounds + 1), heights, color=colour, ls=style, lw=1.8, label=label)
        rule(axes, DIVERGED, weka.rounds, "below this, equal models")
        if weka.weka_itself.parts is not None:
            axes.axvline(weka.weka_itself.parts, color=RED, lw=1)
            said = f"round {weka.weka_itself.parts}:\nthe Weka runs diverge"
            axes.annotate(said, (weka.weka_itself.parts, 1e-5), (6, 0), textcoords="offset points", color=RED)
        axes.set(xlim=(0, weka.rounds), xlabel="round of boosting", ylabel="largest difference of a probability")
        powers(axes, range(-16, 1, 4))
        axes.set_ylim(_NOTHING, 30)
        figure.legend(frameon=False, loc="outside upper left")
        return rendered(figure, kind)


def draw_widths(widths: Sequence["Width"], kind: str = "svg") -> bytes:
    """Draw the worst loss of a lead and the remaining accuracy, by the width of the tables' integers."""
    with painting(FONT):
        figure, ((losses, rates),) = sheet(1, 2, 3.4)
        bits, rows = [width.bits for width in widths], widths[0].total
        losses.plot(bits, [each.bound for each in widths], color=GREY, ls=":", label="bound: inputs + 1 steps")
        _dots(losses, bits, [each.worst for each in widths], BLUE, "the worst of all frames")
        _dots(rates, bits, [100 * each.correct / rows for each in widths], GREEN, "")
        head(losses, "worst loss of a lead, units of score")
        head(rates, f"accuracy, % of {rows} unseen rows")
        powers(losses, exponents(losses))
        losses.legend(frameon=False)
        rule(rates, 100 * widths[0].correct_ensemble / rows, bits[-1], "the ensemble, in doubles")
        rates.grid(axis="y", color="#dddddd", lw=0.6)
        for axes in (losses, rates):
            axes.set(xlabel="bits an entry of the tables", xticks=bits[::2])
        return rendered(figure, kind)


def _dots(axes: "Axes", bits: list[int], heights: list[float], colour: str, label: str) -> None:
    axes.plot(bits, heights, color=colour, marker="o", ms=4, lw=1.6, label=label)


class Ranges(msgspec.Struct, frozen=True):
    """The state after every round: lists with one number per round.

    Least and greatest of positive values, NaN if there are none; mean_scores are the largest |mean over the classes of
    F| of any row.
    """

    name: str
    least_probability: list[float]
    greatest_probability: list[float]
    least_weight: list[float]
    greatest_weight: list[float]
    losses: list[float]
    mean_scores: list[float]


def ranges_of(hard: HardSet, rounds: int) -> Ranges:
    """Train on `hard` and return the ranges."""
    stumps, _ = boost(hard.X, hard.labels, hard.n_classes, rounds=rounds, weights=hard.weights)
    numbers = [
        (*_ends(moment.shares), *_ends(moment.weights), moment.loss, mean_score(moment.scores))
        for moment in moments(hard, stumps)
    ]
    return Ranges(hard.name, *(list(series) for series in zip(*numbers[1:], strict=True)))


def _ends(numbers: Floats) -> tuple[float, float]:
    positive = numbers[numbers > 0]
    return (float(positive.min()), float(positive.max())) if positive.size else (math.nan, math.nan)


WIDTHS = range(4, 17)


class Width(msgspec.Struct, frozen=True):
    """Integers of `bits` bits compared with their ensemble, on `total` unseen rows.

    scale is in steps per unit of score. worst_steps is the largest exact loss of any frame's lead over another grasp
    type; worst and bound are that and (inputs + 1) steps in units of score. correct and correct_ensemble count correct
    predictions, kept those equal to the ensemble's.
    """

    bits: int
    scale: float
    worst_steps: float
    worst: float
    bound: float
    total: int
    correct: int
    correct_ensemble: int
    kept: int

    @property
    def rate(self) -> float:
        """The accuracy with these integers."""
        return self.correct / self.total


def widths(full: bool) -> list[Width]:
    """Return the cost of each width, on a set in which a fifth of the switches read wrongly."""
    rows, rounds = (600, 100) if full else (300, 60)
    trained, unseen = (small_set(seed, rows, switches=24, joints=4, types=8, noise=0.2) for seed in (1, 2))
    stumps, _ = boost(_inputs(trained), trained.labels, 8, rounds=rounds)
    tables, expected = collapse(stumps, 24), winners(stumps.scores(_inputs(unseen)))
    found = []
    for bits in WIDTHS:
        integers = quantise(tables, trained.switches, trained.codes, bits)
        worst = Rounding(tables, integers).worst_of_all().loss
        scorer, frames = Scorer(integers), zip(unseen.switches, unseen.codes, strict=True)
        predicted = np.array([first_best(scorer.lanes(*frame)) for frame in frames])
        found.append(
            Width(
                bits=bits,
                scale=integers.scale,
                worst_steps=float(worst),
                worst=float(worst) / integers.scale,
                bound=(tables.n_inputs + 1) / integers.scale,
                total=rows,
                correct=int(np.count_nonzero(predicted == unseen.labels)),
                correct_ensemble=int(np.count_nonzero(expected == unseen.labels)),
                kept=int(np.count_nonzero(predicted == expected)),
            )
        )
    return found


def _inputs(grasps: GraspSet) -> NDArray[np.uint16]:
    return np.hstack([grasps.switches, grasps.codes])


Progress = Callable[[int, int], None]

ROUNDS = 10_000
_TRAININGS = (separable(33), noisy(14, 140, 1 / 3, seed=1))


class Measured(msgspec.Struct, frozen=True):
    """The numbers of the pictures, except for Weka's."""

    trainings: tuple[Ranges, ...]
    widths: tuple[Width, ...]


def measure(*, full: bool, jobs: int = -1, rounds: int = ROUNDS, progress: Progress | None = None) -> Measured:
    """Measure the numbers. Raises BrokenExecutor if a worker is killed."""
    progress = progress or (lambda done, total: None)
    numbers = range(len(_TRAININGS))
    progress(0, len(numbers))
    found = {}
    for number, ranges in in_workers(partial(_training, rounds=rounds), numbers, jobs):
        found[number] = ranges
        progress(len(found), len(numbers))
    return Measured(tuple(found[number] for number in numbers), tuple(widths(full)))


def figures(measured: Measured, weka: Comparison | NotRun | None) -> tuple[Picture, ...]:
    """Return the pictures of the page in order, without Weka's if it was not requested."""
    return (_ranges(measured), *(() if weka is None else (_weka(weka),)), _widths(measured))


def _training(number: int, rounds: int) -> tuple[int, Ranges]:
    return number, ranges_of(_TRAININGS[number], rounds)


def _ranges(measured: Measured) -> Picture:
    rounds = len(measured.trainings[0].losses)
    drift = max(height for ranges in measured.trainings for height in ranges.mean_scores)
    return Picture(
        "ranges",
        f"Probabilities, weights, loss and drift over {rounds:,} rounds.",
        "One set that one switch per class separates at once, and one with noisy labels that is overfitted in the end. "
        "After that the loss and the weights of rows are almost 0: further rounds have nothing to learn, and must "
        "change nothing. The scores of a row have the mean 0; rounding changes it by at most "
        f"{worded(drift)} after any round: a settled training rounds the same step in the same way in every round.",
        draw_ranges(measured.trainings),
    )


def _weka(weka: Comparison | NotRun) -> Picture:
    title = "thenar and Weka, with two exp() settings of the JVM."
    if isinstance(weka, NotRun):
        return Picture("weka", title, weka_lines(weka)[0], None)
    return Picture(
        "weka",
        title,
        f"Trained on {weka.rows} rows of {weka.classes} classes; shown is the largest difference between the "
        f"probabilities of two models for {weka.held_out} other rows. The two settings differ only in the last bit of "
        "some exponentials. No branch of a stump should have an output above 3: Weka's reach "
        f"{worded(weka.weka_value)}, a quotient of rounding residues; thenar's reach {worded(weka.our_value)}.",
        draw_weka(weka),
    )


def _widths(measured: Measured) -> Picture:
    return Picture(
        "widths",
        "The cost of narrower integers.",
        "Left: the largest change that rounding the tables can make to the lead of one grasp type over another, "
        "computed exactly over all possible frames, and its bound. Right: the accuracy on rows that neither the "
        "ensemble nor its tables have seen.",
        draw_widths(measured.widths),
    )
