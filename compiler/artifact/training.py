"""The folds of `compile`: recognisers of the training rows, and their accuracies on the test rows; and which trials a
build was trained on.
"""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.runtime.manifest import Detected, Manifest, Of, Protocol, Recognised
from thenar.runtime.recipe import By, Recipe
from thenar.runtime.segmenting.model import SegmentModel

from ..evaluation.folds import OF, Fold, groups_of, leave_groups_out, leave_one_out, trial_folds
from ..evaluation.rates import UNITS, rated
from ..movements.segments import learnt
from ..movements.streams import TICK_US, streams_of
from ..placement.constraints import Limits
from ..placement.ports import PortCosts
from ..recogniser import Classes, Groups, Recogniser, Scores, check_inputs
from ..recordings import RecordingError
from ..recordings.graspset import GraspSet
from ..recordings.summary import check_trials
from ..samples import Samples
from ..trainers.base import Report, Training
from ..wearer_study import Hits, chosen_strength, hits_of
from ..workers import check_memory, in_workers, little
from . import CompileError
from .ensemble import MAX_STUMPS

USUAL_ROUNDS = 100  # assumed amount of work where the fit is still to be chosen
# The scores of a fold's test rows, and what adapting to people left out brings.
Test = Callable[[Fold], tuple[Scores, list[Hits]]]
_DIGITS = 8  # of a digest of a trial
# More would make build.json too large to load.
_MOST_DIGESTS = 1 << 20


def samples_of(grasp_set: GraspSet, options: Recipe) -> Samples:
    """Return the samples of `grasp_set` for the option `inputs`. Raises CompileError if nothing can be learned."""
    for kind, names in (("switches", grasp_set.element_names), ("joints", grasp_set.joint_names)):
        if options.inputs == kind and not names:
            raise CompileError(f"the recordings have no {kind}: choose other inputs than {kind!r}")
    if (types := len(np.unique(grasp_set.labels[~grasp_set.is_none]))) < 2:
        raise CompileError(f"the recordings hold {types} grasp type(s): there is nothing to distinguish")
    samples = Samples.of(grasp_set, options.inputs)
    joints = samples.codes.shape[1]
    if options.keep_joints is not None and not joints:
        raise CompileError("the recordings have no joints to choose from: leave ``keep_joints`` out")
    elements, joints = min(options.keep or 0, len(grasp_set.element_names)), min(options.keep_joints or joints, joints)
    check_inputs(samples.n_classes, elements, joints, CompileError)
    check_memory(len(samples.codes), samples.n_classes, CompileError)
    rounds = max(int(training.settings.get("rounds") or 0) for training in Training.candidates(options))
    if (stumps := rounds * samples.n_classes) > MAX_STUMPS:
        raise CompileError(
            f"{rounds} rounds of {samples.n_classes} grasp types are {stumps} stumps; a build has at most "
            f"{MAX_STUMPS}: boost for fewer rounds"
        )
    if options.folds:
        check_trials(grasp_set, CompileError)
    return samples


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
    groups = groups_of(grasp_set, by)
    assert groups is not None
    return (Cut(OF[by], tuple(leave_groups_out(groups, by)), groups), pooled)


@dataclass(frozen=True, slots=True, eq=False)
class Tested:
    """The result of the folds.

    The rates, the headline first; the confusion matrix (K, K) of frames in the headline folds, with a row for each true
    class; the scores of all rows (n, K), from the first folds that all learn from rows of nothing held, if any do; and
    the strength with which the build is adapted to a person.
    """

    rates: tuple[Recognised, ...]
    detection: tuple[Detected, ...]
    confusion: NDArray[np.intp]
    scores: Scores
    strength: float


def scores_of(
    samples: Samples, options: Recipe, ports: PortCosts | None, groups: Groups, limits: Limits | None, fold: Fold
) -> tuple[Scores, list[Hits]]:
    """Fit a recogniser on the fold's training rows only; return its scores of the test rows: see `Recogniser.scores`,
    and what adapting it to people left out brings.

    Raises CompileError, which names the fold.
    """
    try:
        recogniser = Recogniser.fit(samples, options, fold.train, ports=ports, limits=limits, groups=groups)
    except CompileError as wrong:
        raise CompileError(f"in fold {fold.name}: {wrong}, or compile without folds (0)") from None
    tested = samples.rows(fold.test)
    return recogniser.scores(tested), hits_of(recogniser, tested)


def fold_results(
    grasp_set: GraspSet,
    samples: Samples,
    recipe: Recipe,
    *,
    ports: PortCosts | None = None,
    limits: Limits | None = None,
    jobs: int = -1,
    report: Report | None = None,
) -> Tested | None:
    """Return the result of a recipe's folds, None without folds: in every fold, elements and joints are chosen and a
    model is trained on the training rows alone. `samples` are those of `samples_of`.

    Raises CompileError or EvaluationError for recordings that do not allow it.
    """
    cuts = cuts_of(grasp_set, recipe)
    if not cuts:
        return None
    tasks = [(place, fold) for place, cut in enumerate(cuts) for fold in cut.folds]
    test = partial(_done, partial(scores_of, samples, recipe, ports, groups_for(grasp_set, recipe), limits))
    classes = np.empty((len(cuts), len(samples.labels)), np.intp)
    scores = np.empty((len(samples.labels), samples.n_classes))
    knows = [trained_with_rest(samples, cut) for cut in cuts]
    # Segments are learned from folds that know rows in which nothing is held, if there are any.
    scored = next((place for place, rows in enumerate(knows) if rows.all()), 0)
    jobs = little(len(tasks) * len(samples.labels) * (recipe.rounds or USUAL_ROUNDS), jobs)
    adapted = list[Hits]()
    for done, (place, fold, (fold_scores, hits)) in enumerate(in_workers(test, tasks, jobs), 1):
        classes[place, fold.test] = fold_scores.argmax(axis=1)
        adapted += hits
        if place == scored:
            scores[fold.test] = fold_scores[:, : samples.n_classes]
        if report is not None:
            report(done, len(tasks))
    refuses = not samples.has_none and bool((classes == samples.n_classes).any())
    confusion = np.zeros((samples.n_classes + refuses,) * 2, dtype=np.intp)
    np.add.at(confusion, (samples.labels[knows[0]], classes[0, knows[0]]), 1)
    rates, detection = list[Recognised](), list[Detected]()
    for cut, predicted in zip(cuts, classes, strict=True):
        rates += rates_of("nested", samples, predicted, recipe.seed, cut)
        detection += detection_of("nested", samples, predicted, recipe.seed, cut)
    strength, adapted_rates = chosen_strength(adapted, len(cuts[0].folds), recipe.seed)
    return Tested((*rates, *adapted_rates), tuple(detection), confusion, scores, strength)


def trained_with_rest(samples: Samples, cut: "Cut") -> NDArray[np.bool_]:
    """Return which rows (n,) are tested by a fold whose training rows include some in which nothing is held.

    If none do, return all rows. When only one subject's whole movements were recorded, the fold that tests this subject
    has no such training rows.
    """
    mask = np.ones(len(samples.labels), bool)
    for fold in cut.folds if samples.has_none else ():
        mask[fold.test] = samples.is_none[fold.train].any()
    return mask


def _done(test: Test, task: tuple[int, Fold]) -> tuple[int, Fold, tuple[Scores, list[Hits]]]:
    place, fold = task
    return place, fold, test(fold)


def segments_for(grasp_set: GraspSet, samples: Samples, scores: Scores | None, scale: float) -> SegmentModel | None:
    """Return the segment costs for tables with `scale` steps per unit; None without movements.

    They are learned from whole movements and from the scores (n, K) of folds.
    """
    if not samples.is_none.any():
        return None
    try:
        streams = streams_of(grasp_set)
    except RecordingError:
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
    predicted = (predicted == samples.n_types).astype(np.intp)
    knows = np.ones(len(none), bool) if cut is None else trained_with_rest(samples, cut)
    grasps, empty = (
        {
            rate.unit: rate
            for rate in _rates(protocol, samples, predicted, none.astype(np.intp), rows & knows, seed, cut)
        }
        for rows in (~none, none)
    )
    units = [unit for unit in UNITS if unit in grasps or unit in empty]
    return tuple(Detected(grasps.get(unit, grasps["trials"]), empty.get(unit, empty.get("trials"))) for unit in units)


def _rates(
    protocol: Protocol,
    samples: Samples,
    predicted: Classes,
    labels: Classes,
    rows: NDArray[np.bool_],
    seed: int,
    cut: Cut | None,
) -> tuple[Recognised, ...]:
    """Return the result of `rated` on these rows (n,)."""
    cut = cut or Cut("pooled", ())
    if not rows.any():
        return ()
    groups = None if cut.groups is None else cut.groups[rows]
    rates = rated(predicted[rows], labels[rows], samples.trials[rows], of=cut.of, groups=groups)
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
        for rate in rates
        if rate is not None
    )


def _digests(grasp_set: GraspSet) -> list[str]:
    """Return a digest of each trial: of its grasp type, the names of all columns, and its different frames.

    Names of subjects and objects and numbers of trials do not count: `merge` and a new import may change them.
    """
    names = (*grasp_set.switch_names, *grasp_set.joint_names, *grasp_set.taxel_names)
    order = sorted(range(len(names)), key=names.__getitem__)
    head = msgspec.json.encode([names[column] for column in order])
    values = np.hstack([grasp_set.switches, grasp_set.codes, grasp_set.taxels])[:, order].astype("<u2")
    trials = grasp_set.trial_ids
    rows = np.argsort(trials, kind="stable")
    frames = np.split(rows, np.flatnonzero(np.diff(trials[rows])) + 1) if len(rows) else []
    digests = []
    for places in frames:
        parts = (
            head,
            str(grasp_set.grasps[places[0]]).encode(),
            *sorted({frame.tobytes() for frame in values[places]}),
        )
        digests.append(hashlib.sha256(b"".join(parts)).hexdigest()[:_DIGITS])
    return digests


def stored_digests(grasp_set: GraspSet) -> str:
    """Return the digests of a training set for `Origin.trials`."""
    return "".join(sorted(set(_digests(grasp_set)))[:_MOST_DIGESTS])


def trained_on(manifest: Manifest, grasp_set: GraspSet) -> NDArray[np.bool_]:
    """Return which trials (T,) of a set the build was trained on: those with the same frames as a training trial."""
    source, digests = manifest.source, _digests(grasp_set)
    if grasp_set.fingerprint() == source.fingerprint:
        return np.ones(len(digests), bool)
    trials = source.trials + ("" if manifest.adapted is None else manifest.adapted.source.trials)
    stored = {trials[at : at + _DIGITS] for at in range(0, len(trials), _DIGITS)}
    return np.array([digest in stored for digest in digests], bool)
