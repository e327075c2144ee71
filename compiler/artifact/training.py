"""The folds of `compile`: recognisers of the training rows, and their accuracies on the test rows."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.manifest import Detected, Of, Protocol, Recognised
from thenar.runtime.recipe import By, Recipe
from thenar.runtime.segmenting.model import SegmentModel

from ..evaluation.folds import OF, Fold, groups_of, leave_groups_out, leave_one_out, trial_folds
from ..evaluation.rates import UNITS, rated
from ..limits import check_inputs, check_memory, check_types
from ..movements.learning import learnt
from ..movements.streams import TICK_US, MovementError, streams_of
from ..placement.constraints import Limits
from ..placement.ports import PortCosts
from ..recogniser import Classes, Groups, Recogniser, Scores
from ..recordings.graspset import GraspSet
from ..recordings.summary import check_trials
from ..samples import Samples
from ..trainers.base import Report, Training
from ..workers import in_workers, little
from . import CompileError
from .ensemble import MAX_STUMPS


def samples_of(grasp_set: GraspSet, options: Recipe) -> Samples:
    """Return the samples of `grasp_set` for the option `inputs`. Raises CompileError if nothing can be learned."""
    wanted = options.inputs
    for kind, names in (("switches", grasp_set.element_names), ("joints", grasp_set.joint_names)):
        if wanted == kind and not names:
            raise CompileError(f"the recordings have no {kind}: choose other inputs than {kind!r}")
    if (types := len(np.unique(grasp_set.labels[~grasp_set.is_none]))) < 2:
        raise CompileError(f"the recordings hold {types} grasp type(s): there is nothing to distinguish")
    samples = Samples.of(grasp_set, wanted)
    found = samples.n_classes
    if options.keep_joints is not None and not samples.codes.shape[1]:
        raise CompileError("the recordings have no joints to choose from: leave ``keep_joints`` out")
    there = samples.codes.shape[1]
    joints = min(options.keep_joints or there, there)
    check_types(found, CompileError)
    check_inputs(found, min(options.keep or 0, len(grasp_set.element_names)), joints, CompileError)
    check_memory(len(samples.codes), found, CompileError)
    rounds = max(int(each.settings.get("rounds") or 0) for each in Training.candidates(options))
    if rounds * found > MAX_STUMPS:
        raise CompileError(
            f"{rounds} rounds of {found} grasp types are {rounds * found} stumps; a build has at most {MAX_STUMPS}: "
            "boost for fewer rounds"
        )
    return samples


USUAL_ROUNDS = 100  # assumed amount of work where the fit is still to be chosen

Test = Callable[[Fold], Scores]


@dataclass(frozen=True, slots=True, eq=False)
class Cut:
    """Folds of all rows; what is new about their test rows, and the group of each row (n,) for that."""

    of: Of
    folds: tuple[Fold, ...]
    groups: Groups = None


def groups_for(grasp_set: GraspSet, options: Recipe) -> Groups:
    """Return the subject, object or session of each row (n,), if the headline rate is for new ones."""
    return groups_of(grasp_set, _by(grasp_set, options))


def _by(grasp_set: GraspSet, options: Recipe) -> By:
    return options.by or ("subject" if (grasp_set.subjects != grasp_set.subjects[0]).any() else "trial")


def cuts_of(grasp_set: GraspSet, options: Recipe) -> tuple[Cut, ...]:
    """Return the folds for each rate to measure, the headline first; none without folds.

    No fold splits a movement. Raises EvaluationError where the recordings cannot be divided that way.
    """
    if not options.folds:
        return ()
    several = (grasp_set.subjects != grasp_set.subjects[0]).any()
    trials = trial_folds(grasp_set.labels, grasp_set.movement_ids, options.folds, options.seed)
    pooled = Cut("pooled" if several else "within subject", tuple(trials))
    by = _by(grasp_set, options)
    if by == "trial":
        return (pooled,)
    if by == "session":
        for subject in np.unique(grasp_set.subjects).tolist():
            leave_one_out(grasp_set.sessions[grasp_set.subjects == subject], f"session of subject {subject}")
    names = groups_of(grasp_set, by)
    assert names is not None
    return (Cut(OF[by], tuple(leave_groups_out(names, by)), names), pooled)


@dataclass(frozen=True, slots=True, eq=False)
class Tested:
    """The result of the folds.

    The rates, the headline first; the confusion matrix (K, K) of frames in the headline folds, with a row for each true
    class; the scores of all rows (n, K), from the first folds that all learn from rows of nothing held, if any do.
    """

    rates: tuple[Recognised, ...]
    detection: tuple[Detected, ...]
    confusion: NDArray[np.intp]
    scores: Scores


def scores_of(
    samples: Samples, options: Recipe, ports: PortCosts | None, groups: Groups, limits: Limits | None, fold: Fold
) -> Scores:
    """Fit a recogniser on the fold's training rows only; return its scores of the test rows: see `Recogniser.scores`.

    Raises CompileError, which names the fold.
    """
    try:
        recogniser = Recogniser.fit(samples, options, fold.train, ports=ports, limits=limits, groups=groups)
    except CompileError as wrong:
        raise CompileError(f"in fold {fold.name}: {wrong}, or compile without folds (0)") from None
    return recogniser.scores(samples.rows(fold.test))


def cross_validated(
    samples: Samples, cuts: Sequence[Cut], options: Recipe, test: Test, jobs: int, report: Report
) -> Tested | None:
    """Return the result of the folds, None without folds; `test` returns the scores of a fold's test rows.

    jobs  worker processes that call `test`; report: called with (done, total) after each fold
    """
    if not cuts:
        return None
    folds = [(place, fold) for place, cut in enumerate(cuts) for fold in cut.folds]
    predicted = np.empty((len(cuts), len(samples.labels)), np.intp)
    scores = np.empty((len(samples.labels), samples.n_classes))
    knows = [trained_with_rest(samples, cut) for cut in cuts]
    # Segments are learned from folds that know rows in which nothing is held, if there are any.
    scored = next((place for place, rows in enumerate(knows) if rows.all()), 0)
    tasks = ((place, fold, test) for place, fold in folds)
    for done, (place, fold, found) in enumerate(
        in_workers(_done, tasks, little(len(folds) * len(samples.labels) * (options.rounds or USUAL_ROUNDS), jobs)), 1
    ):
        predicted[place, fold.test] = found.argmax(axis=1)
        if place == scored:
            scores[fold.test] = found[:, : samples.n_classes]
        report(done, len(folds))
    refuses = not samples.has_none and bool((predicted == samples.n_classes).any())
    confusion = np.zeros((samples.n_classes + refuses,) * 2, dtype=np.intp)
    np.add.at(confusion, (samples.labels[knows[0]], predicted[0, knows[0]]), 1)
    measured, seed = list(zip(cuts, predicted, strict=True)), options.seed
    rates = [rate for cut, own in measured for rate in rates_of("nested", samples, own, seed, cut)]
    detection = [each for cut, own in measured for each in detection_of("nested", samples, own, seed, cut)]
    return Tested(tuple(rates), tuple(detection), confusion, scores)


def rates_of_recipe(
    grasp_set: GraspSet,
    recipe: Recipe,
    *,
    ports: PortCosts | None = None,
    limits: Limits | None = None,
    jobs: int = -1,
    report: Report | None = None,
) -> tuple[Recognised, ...]:
    """Return the accuracies that `compile_build` would measure, the headline first: in every fold, elements and joints
    are chosen and a model is trained on the training rows alone.

    Raises CompileError or EvaluationError for recordings that do not allow it.
    """
    samples = samples_of(grasp_set, recipe)
    check_trials(grasp_set, CompileError)
    test = partial(scores_of, samples, recipe, ports, groups_for(grasp_set, recipe), limits)
    tested = cross_validated(samples, cuts_of(grasp_set, recipe), recipe, test, jobs, report or (lambda *_: None))
    return () if tested is None else tested.rates


def trained_with_rest(samples: Samples, cut: "Cut") -> NDArray[np.bool_]:
    """Return which rows (n,) are tested by a fold whose training rows include some in which nothing is held.

    If none do, return all rows. When only one subject's whole movements were recorded, the fold that tests this subject
    has no such training rows.
    """
    found = np.ones(len(samples.labels), bool)
    for fold in cut.folds if samples.has_none else ():
        found[fold.test] = samples.is_none[fold.train].any()
    return found


def _done(task: tuple[int, Fold, Test]) -> tuple[int, Fold, Scores]:
    place, fold, test = task
    return place, fold, test(fold)


def segments_for(grasp_set: GraspSet, samples: Samples, scores: Scores | None, scale: float) -> SegmentModel | None:
    """Return the segment costs for tables with `scale` steps per unit; None without movements.

    They are learned from whole movements and from the scores (n, K) of folds.
    """
    if not samples.is_none.any():
        return None
    try:
        streams = streams_of(grasp_set)
    except MovementError:
        return None
    return learnt(streams, samples.labels, scores, samples.n_types, scale, TICK_US)


def rates_of(
    protocol: Protocol, samples: Samples, predicted: Classes, seed: int, cut: Cut | None = None
) -> tuple[Recognised, ...]:
    """Return the accuracy by trials of grasps, and by their frames where trials have several."""
    return _rates(protocol, samples, predicted, samples.labels, ~samples.is_none, seed, cut)


def detection_of(
    protocol: Protocol, samples: Samples, predicted: Classes, seed: int, cut: Cut | None = None
) -> tuple[Detected, ...]:
    """Return the detection rates: of trials with a grasp, and of trials without one, that are detected as such.

    Frames have rates as well where trials have several. There are no rates if no row is labelled as holding nothing.
    """
    none = samples.is_none
    if not (none.any() or (predicted == samples.n_types).any()):
        return ()
    said = (predicted == samples.n_types).astype(np.intp)
    knows = np.ones(len(none), bool) if cut is None else trained_with_rest(samples, cut)
    held, empty = (
        {rate.unit: rate for rate in _rates(protocol, samples, said, none.astype(np.intp), rows & knows, seed, cut)}
        for rows in (~none, none)
    )
    units = [unit for unit in UNITS if unit in held or unit in empty]
    return tuple(Detected(held.get(unit, held["trials"]), empty.get(unit, empty.get("trials"))) for unit in units)


def _rates(
    protocol: Protocol,
    samples: Samples,
    predicted: Classes,
    truth: Classes,
    rows: NDArray[np.bool_],
    seed: int,
    cut: Cut | None,
) -> tuple[Recognised, ...]:
    """Return the result of `rated` on these rows (n,)."""
    cut = cut or Cut("pooled", ())
    if not rows.any():
        return ()
    groups = None if cut.groups is None else cut.groups[rows]
    found = rated(predicted[rows], truth[rows], samples.trials[rows], of=cut.of, groups=groups)
    return tuple(
        Recognised(
            protocol=protocol,
            folds=len(cut.folds),
            seed=seed,
            correct=rate.correct[0],
            total=rate.total,
            of=cut.of,
            unit=rate.unit,
            # The last digits of a quantile can differ between machines.
            low=round(rate.low, 6),
            high=round(rate.high, 6),
        )
        for rate in found
        if rate is not None
    )
