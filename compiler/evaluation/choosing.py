"""Model selection inside the training rows: the trainer and its settings are chosen on inner folds.

Inner folds split no movement; if the fit is to generalise to new subjects (objects, sessions), they also leave subjects
out. Each candidate is scored by its accuracy on trials, ties by log-loss. Candidates within one standard error of the
difference to the best are considered equal; of these, those with small tables are cheap to deploy, and the one with the
lowest log-loss among them is taken. Rows in which nothing is held count only in the log-loss. For trials of many
frames, a subset of the frames suffices for the comparison.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from math import fsum, sqrt

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.manifest import Compared, Fitting, Of
from thenar.runtime.model.tables import ScoreTables

from ..elementary import softmax_and_loss
from ..model.collapse import collapse
from ..samples import Samples, decided
from ..trainers.base import TRAINERS, Model, Training
from ..workers import in_workers
from .folds import Fold, leave_groups_out, trial_folds

Rows = NDArray[np.intp]

# Training sets with fewer trials than this are cut into this many inner folds, larger ones into two.
_FOLDS = ((1500, 4), (20_000, 3))
_LEAST_GROUPS = 3
# Tables of eight kilobytes, at a byte per entry, fit the smallest microcontrollers; larger ones are small up to a
# quarter above the smallest.
_SMALL, _LARGER = 8192, 1.25
# Frames of a trial resemble their neighbours: of more rows than this, evenly spaced ones suffice to compare fits, at
# least this many per trial.
_COMPARED, _FRAMES = 2048, 8


def inner_folds(samples: Samples, seed: int, groups: NDArray[np.generic] | None = None) -> list[Fold]:
    """Return folds of training rows that split no movement, and no group if there are three or more.

    For a single group there are no folds.

    groups  (n,) the subject, object or session of each row, if those are left out
    """
    n_trials = len(np.unique(samples.movements))
    number = next((folds for most, folds in _FOLDS if n_trials < most), 2)
    if groups is not None and len(np.unique(groups)) >= _LEAST_GROUPS:
        return leave_groups_out(groups, "group", number)
    if n_trials < 2:
        return []
    return trial_folds(samples.labels, samples.movements, min(number, n_trials), seed)


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
    some = _spread(samples)
    samples, groups = samples.rows(some), None if groups is None else groups[some]
    folds = inner_folds(samples, seed, groups) if len(candidates) > 1 else []
    if not folds:
        return Fitting(candidates[0].trainer, _values(candidates[0]))
    grouped = groups is not None and len(np.unique(groups)) >= _LEAST_GROUPS
    clusters = groups if grouped and groups is not None else samples.movements
    together = [list(each) for _, each in groupby(range(len(candidates)), lambda one: _alike(candidates[one]))]
    tasks = [(samples, fold, [candidates[one] for one in batch], batch) for fold in folds for batch in together]
    tests: dict[tuple[int, str], _Test] = {}
    for done, (name, batch, found) in enumerate(in_workers(_tested, tasks, jobs), 1):
        tests |= {(one, name): test for one, test in zip(batch, found, strict=True)}
        if report is not None:
            report(done, len(tasks) + 1)
    scores = [_joined([tests[one, fold.name] for fold in folds]) for one in range(len(candidates))]
    if not grouped:
        of = "pooled" if np.ptp(samples.subjects) else "within subject"
    return _fitting(candidates, scores, clusters, samples.n_classes, of, len(folds))


def _spread(samples: Samples) -> Rows:
    rows = len(samples.labels)
    frames = rows // len(np.unique(samples.trials))
    return np.arange(0, rows, max(1, min(frames // _FRAMES, -(-rows // _COMPARED))))


def _values(training: Training) -> dict[str, float | str | None]:
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
    the number of trials including those without a grasp, the sum of their losses, and the rows of its tables.
    """

    first: Rows
    hits: NDArray[np.bool_]
    trials: int
    loss: float
    rows: float


def _joined(tests: list[_Test]) -> _Test:
    """Return the result over all inner folds: the mean loss, and the mean number of rows."""
    trials = sum(test.trials for test in tests)
    return _Test(
        np.concatenate([test.first for test in tests]),
        np.concatenate([test.hits for test in tests]),
        trials,
        round(fsum(test.loss for test in tests) / trials, 6),
        sum(test.rows for test in tests) / len(tests),
    )


_Task = tuple[Samples, Fold, list[Training], list[int]]


def _tested(task: _Task) -> tuple[str, list[int], list[_Test]]:
    samples, fold, trainings, batch = task
    learning, test = samples.rows(fold.train), samples.rows(fold.test)
    _, first, trial = np.unique(test.trials, return_index=True, return_inverse=True)
    weights, held = 1.0 / np.bincount(trial)[trial], ~test.is_none[first]
    found = []
    for model in _models(trainings, learning):
        scores = model.scores(test.switches, test.codes)
        predicted = decided(scores.argmax(axis=1)[np.newaxis], trial)[0]
        loss = softmax_and_loss(np.ascontiguousarray(scores.T), test.labels, weights)[1] * len(first)
        found.append(
            _Test(
                fold.test[first[held]],
                (predicted == test.labels[first])[held],
                len(first),
                loss,
                _table_rows(collapse(model, samples.n_switches)),
            )
        )
    return fold.name, batch, found


def _models(trainings: list[Training], samples: Samples) -> Iterator[Model]:
    if len(trainings) == 1:
        yield trainings[0].train(samples)
    else:
        rounds = [int(each.settings["rounds"] or 0) for each in trainings]
        yield from trainings[int(np.argmax(rounds))].stages(samples, rounds)


def _table_rows(tables: ScoreTables) -> int:
    """Return the number of rows of scores for the inputs in use: of each switch, bin, cell of a grid, and line."""
    return sum(term.n_rows for term in tables.core_terms if term.largest > 0)


def _error(gains: NDArray[np.intp], clusters: Rows) -> float:
    """Return the standard error of the mean of integers (T,) in clusters, robust to correlation within them."""
    sizes, own, total = np.bincount(clusters), np.zeros(clusters.max() + 1, np.int64), int(gains.sum())
    np.add.at(own, clusters, gains)
    squares = int(((len(gains) * own - sizes * total) ** 2).sum())
    return sqrt(squares * len(sizes) / max(1, len(sizes) - 1)) / len(gains) ** 2


def _fitting(
    candidates: Sequence[Training],
    scores: list[_Test],
    clusters: NDArray[np.generic],
    n_classes: int,
    of: Of,
    n_folds: int,
) -> Fitting:
    # All candidates are tested on the same trials.
    cluster = np.unique(clusters[scores[0].first], return_inverse=True)[1]
    best = min(range(len(scores)), key=lambda one: (-int(scores[one].hits.sum()), scores[one].loss))
    found = []
    for candidate, score in zip(candidates, scores, strict=True):
        lost = scores[best].hits.astype(np.intp) - score.hits
        found.append(
            Compared(
                candidate.trainer,
                _values(candidate),
                correct=int(score.hits.sum()),
                total=len(score.hits),
                error=round(_error(score.hits.astype(np.intp), cluster), 6),
                loss=score.loss,
                behind=round(int(lost.sum()) / len(lost), 6),
                behind_error=round(_error(lost, cluster), 6),
                rows=score.rows,
            )
        )
    near = [one for one, each in enumerate(found) if each.behind <= each.behind_error]
    small = max(_SMALL / n_classes, _LARGER * min(found[one].rows for one in near))
    chosen = min((one for one in near if found[one].rows <= small), key=lambda one: (found[one].loss, one))
    shown = {
        min(
            (one for one, each in enumerate(found) if each.trainer == name),
            key=lambda one: (-found[one].correct, found[one].loss, one),
        )
        for name in {each.trainer for each in found}
    }
    return Fitting(
        candidates[chosen].trainer,
        _values(candidates[chosen]),
        of=of,
        folds=n_folds,
        tried=len(candidates),
        compared=tuple(found[one] for one in sorted(shown | {chosen})),
        why=_why(found, best, chosen),
    )


def _why(found: list[Compared], best: int, chosen: int) -> str:
    one, top = found[chosen], found[best]
    rate = f"{100 * one.rate:.1f} % of {one.total} trials in inner folds"
    if chosen == best:
        return f"it has the highest accuracy, {rate}"
    return (
        f"its accuracy is {rate}, within one standard error of the best, {top.name}, with {100 * top.rate:.1f} %; of "
        "those with small tables it has the lowest log-loss"
    )
