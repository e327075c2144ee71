"""The training of `compile`: choose a placement, fit a model on kept switches and joints, and repeat both in folds."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.manifest import By, Detected, Fitting, Of, Options, Protocol, Recognised, Rejection
from thenar.runtime.rejection import refused
from thenar.runtime.segmenting.model import SegmentModel
from thenar.runtime.tables import IntegerTables

from ..boosting.stumps import Stumps
from ..evaluation.choosing import choose_training
from ..evaluation.folds import Fold, leave_groups_out, leave_one_out, trial_folds
from ..evaluation.populations import OF, groups_of
from ..evaluation.rates import UNITS, rated
from ..limits import check_inputs, check_memory, check_types
from ..movements.learning import learnt
from ..movements.streams import TICK_US, MovementError, streams_of
from ..placement.constraints import Limits
from ..placement.elements import Elements, bits_of, elements_of, ports_of
from ..placement.joints import kept_joints
from ..placement.methods.base import METHODS, PAPERS
from ..placement.placement import choose
from ..placement.ports import PortCosts
from ..placement.tree import Tree
from ..recordings.graspset import GraspSet
from ..samples import Columns, Samples
from ..tables.collapse import Model, collapse
from ..tables.quantise import integer_scores, quantise
from ..tables.standing_in import fit_lost
from ..trainers.base import Report, Training
from ..workers import in_workers, little
from . import CompileError
from .ensemble import MAX_STUMPS, model_fault
from .rejecting import rejection_of

Classes = NDArray[np.intp]
Groups = NDArray[np.str_] | None


@dataclass(frozen=True, slots=True, eq=False)
class Trained:
    """A trained model and the choices behind it.

    elements  switches, and levels of taxels, that were available
    columns   indices of the kept ones among them, in the order in which they were chosen
    gains     the gain of each (bits): in the ID3 tree, where None means that another method chose; else on its own
    joints    columns of the kept joints
    fitting   how the fit was chosen; training: how the model was trained. None for an estimator
    """

    elements: Elements
    columns: Columns
    gains: tuple[float, ...]
    tree: Tree | None
    model: Model
    joints: Columns
    fitting: Fitting | None = None
    training: Training | None = None

    @property
    def kept(self) -> Elements:
        """The kept elements, in the order in which they were chosen."""
        return tuple(self.elements[column] for column in self.columns)

    def read(self, samples: Samples) -> Samples:
        """Return these samples as a glove with only the kept elements and joints reads them."""
        return bits_of(samples.with_joints(self.joints), self.kept)

    @property
    def stopped_after(self) -> int:
        """The number of rounds after which a tolerance ended the training; 0 if none did."""
        early = isinstance(self.model, Stumps) and self.model.stopped_early
        return self.rounds if early else 0

    @property
    def rounds(self) -> int:
        """The number of boosting rounds in the model."""
        return self.model.n_rounds if isinstance(self.model, Stumps) else 0

    @property
    def zero_gain_nodes(self) -> int:
        """The number of tree nodes at which no single switch gained anything."""
        return 0 if self.tree is None else self.tree.n_zero_gain


def samples_of(grasp_set: GraspSet, options: Options) -> Samples:
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


def train(
    samples: Samples,
    options: Options,
    report: Report | None = None,
    ports: PortCosts | None = None,
    groups: Groups = None,
    jobs: int = 1,
    limits: Limits | None = None,
) -> Trained:
    """Choose elements and fit, and train on them and the joints. Raises CompileError if no input separates grasp types.

    Elements and joints are chosen to distinguish grasp types. Rows in which nothing is held are used only for the fit,
    and no more of them than there are rows of grasps.

    ports   the cost of reading switches and taxels, for methods that use it
    groups  for each row (n,), what is left out where the fit is to generalise to new subjects, objects or sessions
    jobs    worker processes that compare fits
    limits  constraints on the placement
    """
    held, rows = samples.without_none(), samples.balanced()
    elements = elements_of(held, options.levels)
    held = bits_of(held, elements)
    # Without switches the tree is a single leaf.
    method = options.placement if held.n_switches else PAPERS
    parameter = options.keep or 0 if METHODS.named(method).by_number else options.prune
    own = None if ports is None else ports_of(ports, elements)
    bound = None if limits is None else limits.on(elements, own)
    chosen = choose(held, method, float(parameter), own, bound, robust=options.robust)
    columns = chosen.columns
    if not columns and not held.codes.shape[1]:
        raise CompileError("no switch is worth keeping: lower ``prune``, or record switches that differ between grasps")
    joints = kept_joints(held.keeping(columns), options.keep_joints, limits)
    kept = bits_of(samples.rows(rows), elements).keeping(columns).with_joints(joints)
    check_inputs(len(samples.grasps), len(columns), len(joints), CompileError)
    inputs = kept.inputs
    if not (inputs != inputs[0]).any():
        raise CompileError("no input differs between rows: nothing distinguishes the grasp types")
    candidates, of = Training.candidates(options), OF[options.by or "subject"]
    by = None if groups is None else groups[rows]
    fitting = choose_training(kept, candidates, seed=options.seed, groups=by, of=of, jobs=jobs, report=report)
    training = Training.chosen(fitting, masked=options.robust)
    model = training.train(kept, report if len(candidates) == 1 else None)
    if fault := model_fault(model, kept.n_switches, kept.codes.shape[1], kept.n_classes):
        raise CompileError(f"trainer {fitting.trainer!r} returned an invalid model that {fault}: fix the trainer")
    return Trained(elements, columns, chosen.gains, chosen.tree, model, joints, fitting, training)


def integers_of(trained: Trained, samples: Samples, options: Options) -> IntegerTables:
    """Return the integer tables of a model trained on these samples."""
    kept = trained.read(samples.rows(samples.balanced()))
    tables = collapse(trained.model, kept.n_switches)
    return quantise(tables, kept.switches, kept.codes, options.width, options.table_bits)


def built_tables(trained: Trained, samples: Samples, options: Options) -> IntegerTables:
    """Return the integer tables of a model trained on these samples, with fitted substitutes for lost inputs."""
    kept = trained.read(samples.rows(samples.balanced()))
    return fit_lost(integers_of(trained, samples, options), kept.switches, kept.codes, kept.labels)


USUAL_ROUNDS = 100  # assumed amount of work where the fit is still to be chosen

Scores = NDArray[np.float64]
Test = Callable[[Fold], Scores]


@dataclass(frozen=True, slots=True, eq=False)
class Cut:
    """Folds of all rows; what is new about their test rows, and the group of each row (n,) for that."""

    of: Of
    folds: tuple[Fold, ...]
    groups: Groups = None


def groups_for(grasp_set: GraspSet, options: Options) -> Groups:
    """Return the subject, object or session of each row (n,), if the headline rate is for new ones."""
    return groups_of(grasp_set, _by(grasp_set, options))


def _by(grasp_set: GraspSet, options: Options) -> By:
    return options.by or ("subject" if (grasp_set.subjects != grasp_set.subjects[0]).any() else "trial")


def cuts_of(grasp_set: GraspSet, options: Options) -> tuple[Cut, ...]:
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
    samples: Samples, options: Options, ports: PortCosts | None, groups: Groups, limits: Limits | None, fold: Fold
) -> Scores:
    """Choose and train on the fold's training rows only; return the scores (m, K), in units, of its test rows.

    Scores come from the integer tables. If frames can be rejected, column K is +infinity for rejected ones and
    -infinity for the others. Raises CompileError, which names the fold, as `train` does.
    """
    learning = samples.rows(fold.train)
    try:
        own = None if groups is None else groups[fold.train]
        trained = train(learning, options, ports=ports, groups=own, limits=limits)
    except CompileError as wrong:
        raise CompileError(f"in fold {fold.name}: {wrong}, or compile without folds (0)") from None
    tables = integers_of(trained, learning, options)
    rejection = rejected_by(trained, learning, tables, options, own)
    test = trained.read(samples.rows(fold.test))
    scores = integer_scores(tables, test.switches, test.codes)
    if rejection is None:
        return scores / tables.scale
    beyond = np.where(refused(rejection, scores, test.switches, test.codes), np.inf, -np.inf)
    return np.column_stack([scores / tables.scale, beyond])


def rejected_by(
    trained: Trained, samples: Samples, tables: IntegerTables, options: Options, groups: Groups
) -> Rejection | None:
    """Return the rejection rule learned from the training rows for these tables; None for an estimator."""
    if trained.training is None:
        return None
    return rejection_of(trained.read(samples), tables, trained.training, options, groups)


def predicted_classes(
    tables: IntegerTables, rejection: Rejection | None, bits: NDArray[np.bool_], codes: NDArray[np.uint16]
) -> Classes:
    """Return the predicted classes (n,) of rows of kept switches (n, s) and codes (n, j); K: rejected."""
    scores = integer_scores(tables, bits, codes)
    found: Classes = scores.argmax(axis=1)
    if rejection is not None:
        found[refused(rejection, scores, bits, codes)] = tables.n_classes
    return found


def cross_validated(
    samples: Samples, cuts: Sequence[Cut], options: Options, test: Test, jobs: int, report: Report
) -> Tested | None:
    """Return the result of the folds, None without folds; `test` returns the scores of a fold's test rows.

    jobs  worker processes that call `test`; report: called with (done, total) after each fold
    """
    if not cuts:
        return None
    folds = [(place, fold) for place, cut in enumerate(cuts) for fold in cut.folds]
    predicted = np.empty((len(cuts), len(samples.labels)), np.intp)
    scores = np.empty((len(samples.labels), samples.n_classes))
    knows = [learns_none(samples, cut) for cut in cuts]
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


def learns_none(samples: Samples, cut: "Cut") -> NDArray[np.bool_]:
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
    knows = np.ones(len(none), bool) if cut is None else learns_none(samples, cut)
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
