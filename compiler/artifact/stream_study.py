"""`evaluate --streams`: how accurately whole movements of new subjects are cut into grasps, live and offline.

Each subject is left out in turn. Placement, model, tables and segment costs are learned from the others, and candidate
costs are compared on inner folds of them. The trainer and its settings are chosen once for these others, with all their
inputs. Of many movements fewer frames each are learnt from. Every row of the result decodes the same scores of the same
tables.
"""

from collections.abc import Mapping
from functools import partial
from statistics import fmean
from typing import Any

import msgspec
import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from thenar.runtime.live.decision import Decision, Ranking
from thenar.runtime.policy import Policy
from thenar.runtime.recipe import Inputs, Recipe
from thenar.runtime.scores import LANE_OFFSET
from thenar.runtime.segmenting.model import SegmentModel

from ..evaluation.folds import Fold, leave_groups_out, trial_folds
from ..evaluation.rates import RecipeWords, student
from ..movements.segments import (
    LAG_TICKS,
    OVERLAPS,
    SegmentScore,
    announced_live,
    live_states,
    score_streams,
    segments_of,
)
from ..movements.streams import TICK_US, in_movements, streams_of
from ..recogniser import Recogniser
from ..recordings import RecordingError
from ..recordings.graspset import GraspSet
from ..samples import FRAMES, Samples
from ..trainers.base import SHARED, Report
from ..workers import in_workers
from .training import scores_of, segments_for

Labels = NDArray[np.intp]
_INNER = 4
_LEARNT = 5500  # most rows to learn from
# The methods compared, in the order of the table; the first is the one that a live glove uses.
METHODS = {
    "decoder, live": f"lag {LAG_TICKS * TICK_US // 1000} ms",
    "decoder, afterwards": "exact",
    "dwell 50 ms": "today's rule",
    "dwell 200 ms": "",
}
SHARES = (*(f"F1@{overlap}" for overlap in OVERLAPS), "edit", "recognised")
TIMES = ("onset ms", "onset 90 % ms", "end ms", "end 90 % ms", "latency ms")
FALSE = "false per 100"


class SubjectMean(msgspec.Struct, frozen=True):
    """A mean over subjects and its 95 % interval (Student's t; None with one subject); None: nothing was measured."""

    mean: float | None
    low: float | None
    high: float | None
    subjects: tuple[float | None, ...]


class MethodRow(msgspec.Struct, frozen=True):
    """The result of one method with some inputs.

    `values` by column: shares in 0..1, times in ms, false announcements per hundred movements.
    """

    inputs: Inputs
    method: str
    what: str
    values: dict[str, SubjectMean]


class StreamStudy(msgspec.Struct, frozen=True):
    """The result: what was trained, the subjects, the number of movements, and the rows."""

    fingerprint: str
    recipe: RecipeWords
    subjects: tuple[str, ...]
    movements: int
    seconds: float
    rows: tuple[MethodRow, ...]


def study_streams(grasp_set: GraspSet, options: Recipe, jobs: int = -1, progress: Report | None = None) -> StreamStudy:
    """Evaluate segmentation on subjects that were left out.

    Parameters
    ----------
    grasp_set : GraspSet
        Whole movements of two or more subjects, with rows in which nothing is held.
    options : Recipe
        How to place and train.
    jobs : int
        Worker processes; the result does not depend on their number.
    progress : callable, optional
        Called with (done, total): at once, and after each subject with each kind of inputs.

    Returns
    -------
    StreamStudy
        A row for each method and kind of inputs.

    Raises
    ------
    RecordingError
        If the set holds no whole movements, no rows in which nothing is held, or only one subject.
    """
    streams = streams_of(grasp_set)
    if not grasp_set.is_none.any():
        raise RecordingError(
            "the set has no rows in which nothing is held: record them (thenar record), or simulate a scene that keeps "
            'every frame (rows = "all")'
        )
    subjects = tuple(sorted({stream.subject for stream in streams}))
    if len(subjects) < 2:
        raise RecordingError(f"the set holds streams of {subjects[0]} only: leaving a subject out takes two")
    given: dict[Inputs, bool] = {"switches": bool(grasp_set.element_names), "joints": bool(grasp_set.joints)}
    kinds = [kind for kind, some in {"both": all(given.values()), **given}.items() if some]
    report, total = progress or (lambda _done, _total: None), len(subjects) * (1 + len(kinds))
    report(0, total)
    chosen: dict[str, Recipe] = {}
    for subject, best in in_workers(partial(_chosen, grasp_set, kinds[0], options), subjects, jobs):
        chosen[subject] = best
        report(len(chosen), total)
    tasks = [(kind, subject, chosen[subject]) for kind in kinds for subject in subjects]
    results: dict[tuple[Inputs, str], dict[str, SegmentScore]] = {}
    for kind, subject, scores in in_workers(partial(_of_subject, grasp_set), tasks, jobs):
        results[kind, subject] = scores
        report(len(chosen) + len(results), total)
    return StreamStudy(
        fingerprint=grasp_set.fingerprint(),
        recipe=RecipeWords.of(options),
        subjects=subjects,
        movements=sum(
            len(segments_of(grasp_set.labels[stream.rows], len(grasp_set.taxonomy.types))) for stream in streams
        ),
        seconds=sum(len(stream.rows) for stream in streams) * TICK_US / 1e6,
        rows=tuple(
            MethodRow(kind, name, what, _row([results[kind, subject][name] for subject in subjects]))
            for kind in kinds
            for name, what in METHODS.items()
        ),
    )


def _learning(
    grasp_set: GraspSet, kind: Inputs, options: Recipe, subject: str
) -> tuple[GraspSet, Samples, NDArray[np.intp]]:
    """Return the rows of all other subjects, as a set and as samples, and the numbers of those to learn from.

    These are all rows, unless the usual frames of each movement are more than _LEARNT: then equally many of each
    movement, or rows drawn from two of each.
    """
    others = grasp_set.rows(grasp_set.subjects != subject)
    samples = Samples.of(grasp_set, kind).rows(grasp_set.subjects != subject)
    movements = len(np.unique(samples.movements))
    if movements * FRAMES <= _LEARNT:
        return others, samples, np.arange(len(others))
    some = samples.balanced(max(2, _LEARNT // movements))
    if len(some) > _LEARNT:
        some = np.sort(np.random.default_rng(options.seed).choice(some, _LEARNT, replace=False))
    return others, samples, some


def _groups(others: GraspSet) -> NDArray[np.str_] | None:
    return others.subjects if len(np.unique(others.subjects)) > 1 else None


def _chosen(grasp_set: GraspSet, kind: Inputs, options: Recipe, subject: str) -> tuple[str, Recipe]:
    """Return the options with the trainer and settings that suit all other subjects best."""
    others, learning, some = _learning(grasp_set, kind, options, subject)
    training = Recogniser.fit(learning.rows(some), options, groups=_groups(others.rows(some))).training
    settings: dict[str, Any] = dict(training.settings)
    return subject, replace(options, trainer=training.trainer, settings=settings, **dict.fromkeys(SHARED))


def _of_subject(grasp_set: GraspSet, task: tuple[Inputs, str, Recipe]) -> tuple[Inputs, str, dict[str, SegmentScore]]:
    kind, subject, options = task
    others, learning, some = _learning(grasp_set, kind, options, subject)
    samples, few = Samples.of(grasp_set, kind), learning.rows(some)
    recogniser = Recogniser.fit(few, options)
    tables = recogniser.integers
    scores = np.zeros((len(others), samples.n_classes))
    for fold in _inner_folds(learning, others, options):
        thinned = Fold(np.intersect1d(fold.train, some), fold.test, fold.name)
        scores[fold.test] = scores_of(learning, options, None, _groups(others), None, thinned)[0]
    model = segments_for(others, learning, scores, tables.scale)
    assert model is not None
    read = recogniser.read(samples)
    parts: dict[str, list[tuple[bool, Labels, Labels, Labels | None]]] = {name: [] for name in METHODS}
    for stream in streams_of(grasp_set):
        if stream.subject == subject:
            part = read.rows(stream.rows)
            whole = tables.scores(part.switches, part.codes)
            for name, (states, announced) in _decoded(whole, model, tables.scale).items():
                parts[name].append((stream.continued, part.labels, states, announced))
    return kind, subject, {name: score_streams(every, model.n_types) for name, every in parts.items()}


def _inner_folds(learning: Samples, others: GraspSet, options: Recipe) -> list[Fold]:
    """Return folds that together test all rows of streams: each leaves out some subjects, or half of the movements of
    the only one.
    """
    rows = np.flatnonzero(in_movements(others))
    several = len(np.unique(others.subjects[rows]))
    if several > 1:
        folds = leave_groups_out(others.subjects[rows], "subject", min(several, _INNER))
    else:
        folds = trial_folds(learning.labels[rows], learning.movements[rows], 2, options.seed)
    every = np.arange(len(others))
    return [Fold(np.setdiff1d(every, rows[fold.test]), rows[fold.test], fold.name) for fold in folds]


def _decoded(
    scores: NDArray[np.int32], model: SegmentModel, scale: float
) -> Mapping[str, tuple[Labels, Labels | None]]:
    """Return each method's result for scores (T, K + 1) of a stream: states, and announcements in time."""
    none, policy = model.n_types, Policy()
    live = live_states(model, scores, LAG_TICKS)
    lead = policy.lead_steps(scale)
    rules = {f"dwell {ms} ms": Decision(lead, 1000 * ms, policy.hold_us) for ms in (50, 200)}
    ruled: dict[str, list[int]] = {name: [] for name in rules}
    for tick, row in enumerate((scores + LANE_OFFSET).tolist()):
        standing = Ranking(tuple(row))
        for name, rule in rules.items():
            ruled[name].append(rule.update(tick * TICK_US, standing))
    return {
        "decoder, live": (live, announced_live(live, none, LAG_TICKS)),
        "decoder, afterwards": (live_states(model, scores, len(scores)), None),
        **{name: (states := np.array(found, np.intp), states) for name, found in ruled.items()},
    }


def _row(scores: list[SegmentScore]) -> dict[str, SubjectMean]:
    def ticks(values: tuple[int, ...], percent: float, *, signed: bool = False) -> float | None:
        size = values if signed else tuple(map(abs, values))
        return float(np.percentile(size, percent)) * TICK_US / 1000 if values else None

    columns: dict[str, list[float | None]] = {
        name: [one.f1(place) for one in scores] for place, name in enumerate(SHARES[: len(OVERLAPS)])
    }
    columns["edit"] = [one.edit for one in scores]
    columns["recognised"] = [one.recognition for one in scores]
    columns["onset ms"] = [ticks(one.onsets, 50) for one in scores]
    columns["onset 90 % ms"] = [ticks(one.onsets, 90) for one in scores]
    columns["end ms"] = [ticks(one.ends, 50) for one in scores]
    columns["end 90 % ms"] = [ticks(one.ends, 90) for one in scores]
    columns["latency ms"] = [ticks(one.latencies, 50, signed=True) for one in scores]
    columns[FALSE] = [100 * one.false / max(one.true, 1) for one in scores]
    return {name: _mean(values, most=1.0 if name in SHARES else None) for name, values in columns.items()}


def _mean(values: list[float | None], most: float | None) -> SubjectMean:
    known = [value for value in values if value is not None]
    if not known:
        return SubjectMean(None, None, None, tuple(values))
    rounded: list[Any] = [None if value is None else round(value, 6) for value in values]
    if len(known) < 2:
        return SubjectMean(round(known[0], 6), None, None, tuple(rounded))
    low, high = student(known)
    low, high = max(low, 0.0) if min(known) >= 0 else low, high if most is None else min(high, most)
    return SubjectMean(round(fmean(known), 6), round(low, 6), round(high, 6), tuple(rounded))
