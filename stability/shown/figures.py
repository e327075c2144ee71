"""What the page shows in pictures: measured on all cores, drawn, and with how to read it."""

from collections.abc import Callable
from functools import partial

import msgspec

from thenar.compiler.workers import in_workers

from ..inputs.hard_data import noisy, separable
from ..weka.beside import Beside, NotRun
from ..wording import besides
from ..wording import figure as worded
from .page import Figure
from .pictures import draw_beside, draw_ranges, draw_widths
from .ranges import Ranges, ranges_of
from .widths import Width, widths

Progress = Callable[[int, int], None]

ROUNDS = 10_000
_TRAININGS = (separable(33), noisy(14, 140, 1 / 3, seed=1))


class Measured(msgspec.Struct, frozen=True):
    """The numbers behind the pictures that need no Weka."""

    trainings: tuple[Ranges, ...]
    widths: tuple[Width, ...]


def measure(*, full: bool, jobs: int = -1, rounds: int = ROUNDS, progress: Progress | None = None) -> Measured:
    """Return the numbers. Raises BrokenExecutor if a worker is killed."""
    progress = progress or (lambda done, total: None)
    numbers = range(len(_TRAININGS))
    progress(0, len(numbers))
    found = {}
    for number, ranges in in_workers(partial(_training, rounds=rounds), numbers, jobs):
        found[number] = ranges
        progress(len(found), len(numbers))
    return Measured(tuple(found[number] for number in numbers), tuple(widths(full)))


def figures(measured: Measured, beside: Beside | NotRun | None) -> tuple[Figure, ...]:
    """Return the pictures of the page in their order; without Weka's where it was not asked for."""
    return (_ranges(measured), *(() if beside is None else (_beside(beside),)), _widths(measured))


def _training(number: int, rounds: int) -> tuple[int, Ranges]:
    return number, ranges_of(_TRAININGS[number], rounds)


def _ranges(measured: Measured) -> Figure:
    rounds = len(measured.trainings[0].losses)
    drift = max(height for ranges in measured.trainings for height in ranges.mean_scores)
    return Figure(
        "ranges",
        f"Probabilities, weights, loss and drift over {rounds:,} rounds.",
        "One set that a switch a class parts at once, and one with noise in its labels that is learned by heart in the "
        "end. What is learned has next to no loss and rows of next to no weight: from there on a round has nothing "
        "left to learn, and must leave things as they are. The scores of a row have the mean 0; what rounding "
        f"leaves of that is at most {worded(drift)} after any round: a settled training rounds the same step in the "
        "same way for ever.",
        draw_ranges(measured.trainings),
    )


def _beside(beside: Beside | NotRun) -> Figure:
    title = "Ours beside Weka's, under two exp() settings of its JVM."
    if isinstance(beside, NotRun):
        return Figure("beside", title, besides(beside)[0], None)
    return Figure(
        "beside",
        title,
        f"Trained on {beside.rows} rows of {beside.classes} classes; shown is the largest difference between the "
        f"probabilities that two answers give to {beside.held_out} other rows. The two settings differ in the last bit "
        "of some exponentials, and in nothing else. No branch of a stump should answer with more than 3: Weka's go up "
        f"to {worded(beside.weka_value)}, which is residue of rounding over residue; thenar's up to "
        f"{worded(beside.our_value)}.",
        draw_beside(beside),
    )


def _widths(measured: Measured) -> Figure:
    return Figure(
        "widths",
        "What narrower integers cost.",
        "Left: the most by which rounding the tables can shift the lead of one grasp type over another, found exactly "
        "over all frames that there can be, beside its bound. Right: what that does to the recognition rate, on rows "
        "that neither the ensemble nor its tables have seen.",
        draw_widths(measured.widths),
    )
