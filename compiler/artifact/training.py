"""What `compile` trains: a placement, then a model on the kept switches and the joints; and both once more in folds."""

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
from ..placement.constraints import Limits
from ..placement.elements import Elements, bits_of, elements_of, ports_of
from ..placement.joints import kept_joints
from ..placement.methods.base import METHODS, PAPERS
from ..placement.placement import choose
from ..placement.ports import PortCosts
from ..placement.tree import Tree
from ..recordings.graspset import GraspSet
from ..samples import Columns, Samples
from ..segmenting.learning import learnt
from ..segmenting.streams import TICK_US, SegmentingError, streams_of
from ..tables.collapse import Model, collapse
from ..tables.quantise import integer_scores, quantise
from ..tables.standing_in import fit_lost
from ..trainers.base import Report, Training
from ..workers import in_workers, little
from . import CompileError
from .ensemble import MAX_STUMPS, model_fault
from .rejecting import rejection_of

Answers = NDArray[np.intp]
Groups = NDArray[np.str_] | None


@dataclass(frozen=True, slots=True, eq=False)
class Trained:
    """What was chosen and trained.

    elements  switches, and levels of taxels, that there were to choose from
    columns   places of the kept ones among them, in the order in which they were chosen
    gains     what each of these brought (bits): to the tree of ID3, which is None where another method chose, and alone
              otherwise
    joints    columns of the kept joints
    fitting   how the fit was chosen; training: what made the model. None where an estimator did
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
        """Return what a glove of the kept elements and joints reads of these rows."""
        return bits_of(samples.with_joints(self.joints), self.kept)

    @property
    def stopped_after(self) -> int:
        """After how many rounds a tolerance ended the training; 0 if none did."""
        early = isinstance(self.model, Stumps) and self.model.stopped_early
        return self.rounds if early else 0

    @property
    def rounds(self) -> int:
        """How many rounds of boosting made the model."""
        return self.model.n_rounds if isinstance(self.model, Stumps) else 0

    @property
    def zero_gain_nodes(self) -> int:
        """At how many decisions of the tree no switch gained anything alone."""
        return 0 if self.tree is None else self.tree.n_zero_gain


def samples_of(grasp_set: GraspSet, options: Options) -> Samples:
    """Return what of `grasp_set` the option `inputs` allows. Raises CompileError if that is nothing to learn from."""
    wanted = options.inputs
    for kind, names in (("switches", grasp_set.element_names), ("joints", grasp_set.joint_names)):
        if wanted == kind and not names:
            raise CompileError(f"the recordings have no {kind}: choose other inputs than {kind!r}")
    if (types := len(np.unique(grasp_set.labels[~grasp_set.is_none]))) < 2:
        raise CompileError(f"the recordings hold {types} grasp type(s): there is nothing to tell apart")
    samples = Samples.of(grasp_set, wanted)
    found = samples.n_classes
    if options.keep_joints is not None and not samples.codes.shape[1]:
        raise CompileError("there are no joints to keep some of: leave keep_joints (--keep-joints) out")
    there = samples.codes.shape[1]
    joints = min(options.keep_joints or there, there)
    check_types(found, CompileError)
    check_inputs(found, min(options.keep or 0, len(grasp_set.element_names)), joints, CompileError)
    check_memory(len(samples.codes), found, CompileError)
    rounds = max(int(each.settings.get("rounds") or 0) for each in Training.candidates(options))
    if rounds * found > MAX_STUMPS:
        raise CompileError(
            f"{rounds} rounds of {found} grasp types are {rounds * found} stumps, a build has at most {MAX_STUMPS}: "
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
    """Choose elements and fit, and train on them and the joints. Raises CompileError if no input tells grasps apart.

    Elements and joints are chosen to tell grasp types apart: rows of nothing held take part in the fit alone, and no
    more of them than there are of grasps.

    ports   what reading switches and taxels costs, for methods that ask
    groups  what of each row (n,) is left out where the fit is to recognise new subjects, objects or sessions
    jobs    worker processes that compare fits
    limits  what the placement must obey
    """
    held, rows = samples.without_none(), samples.balanced()
    elements = elements_of(held, options.levels)
    held = bits_of(held, elements)
    # Without switches the tree is a leaf.
    method = options.placement if held.n_switches else PAPERS
    parameter = options.keep or 0 if METHODS.named(method).by_number else options.prune
    own = None if ports is None else ports_of(ports, elements)
    bound = None if limits is None else limits.on(elements, own)
    chosen = choose(held, method, float(parameter), own, bound, robust=options.robust)
    columns = chosen.columns
    if not columns and not held.codes.shape[1]:
        raise CompileError("no switch is worth keeping: lower --prune, or record switches that differ between grasps")
    joints = kept_joints(held.keeping(columns), options.keep_joints, limits)
    kept = bits_of(samples.rows(rows), elements).keeping(columns).with_joints(joints)
    check_inputs(len(samples.grasps), len(columns), len(joints), CompileError)
    inputs = kept.inputs
    if not (inputs != inputs[0]).any():
        raise CompileError("no input differs between rows: there is nothing to tell grasp types apart by")
    candidates, of = Training.candidates(options), OF[options.by or "subject"]
    by = None if groups is None else groups[rows]
    fitting = choose_training(kept, candidates, seed=options.seed, groups=by, of=of, jobs=jobs, report=report)
    training = Training.chosen(fitting, masked=options.robust)
    model = training.train(kept, report if len(candidates) == 1 else None)
    if fault := model_fault(model, kept.n_switches, kept.codes.shape[1], kept.n_classes):
        raise CompileError(f"trainer {fitting.trainer!r} made a model that {fault}: it is at fault")
    return Trained(elements, columns, chosen.gains, chosen.tree, model, joints, fitting, training)


def integers_of(trained: Trained, samples: Samples, options: Options) -> IntegerTables:
    """Return the integer tables of what was trained on these samples."""
    kept = trained.read(samples.rows(samples.balanced()))
    tables = collapse(trained.model, kept.n_switches)
    return quantise(tables, kept.switches, kept.codes, options.width, options.table_bits)


def built_tables(trained: Trained, samples: Samples, options: Options) -> IntegerTables:
    """Return the integer tables of what was trained on these samples, with what stands in for lost inputs fitted."""
    kept = trained.read(samples.rows(samples.balanced()))
    return fit_lost(integers_of(trained, samples, options), kept.switches, kept.codes, kept.labels)


USUAL_ROUNDS = 100  # where a fit is chosen, its work is taken to be that of so many

Scores = NDArray[np.float64]
Test = Callable[[Fold], Scores]


@dataclass(frozen=True, slots=True, eq=False)
class Cut:
    """Folds of all rows; what is new about the rows that they test, and to whom or what each row (n,) belongs then."""

    of: Of
    folds: tuple[Fold, ...]
    groups: Groups = None


def groups_for(grasp_set: GraspSet, options: Options) -> Groups:
    """Return the subject, object or session of each row (n,), if the headline is of new ones."""
    return groups_of(grasp_set, _by(grasp_set, options))


def _by(grasp_set: GraspSet, options: Options) -> By:
    return options.by or ("subject" if (grasp_set.subjects != grasp_set.subjects[0]).any() else "trial")


def cuts_of(grasp_set: GraspSet, options: Options) -> tuple[Cut, ...]:
    """Return the folds of each rate that is to be measured, those of the headline first; none without folds.

    No fold parts a movement. Raises EvaluationError where the recordings cannot be cut so.
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
    """What came of the folds: the rates, the headline first; and how often frames of each class (rows) were answered by
    each (columns) in the folds of the headline, (K, K); and the scores of all rows, (n, K), in the first folds that all
    learn from rows of nothing held, if the set has any.
    """

    rates: tuple[Recognised, ...]
    detection: tuple[Detected, ...]
    confusion: NDArray[np.intp]
    scores: Scores


def scores_of(
    samples: Samples, options: Options, ports: PortCosts | None, groups: Groups, limits: Limits | None, fold: Fold
) -> Scores:
    """Choose and train on the fold's training rows alone; return the scores (m, K), in units, that the integers give
    its test rows. Where frames are refused, column K is infinite for those that are, and else its negative.

    Raises CompileError, which names the fold, as `train` does.
    """
    learning = samples.rows(fold.train)
    try:
        own = None if groups is None else groups[fold.train]
        trained = train(learning, options, ports=ports, groups=own, limits=limits)
    except CompileError as wrong:
        raise CompileError(f"in fold {fold.name}: {wrong}, or do without folds (0)") from None
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
    """Return what a build of these tables refuses, learnt from the rows trained on; None of an estimator's."""
    if trained.training is None:
        return None
    return rejection_of(trained.read(samples), tables, trained.training, options, groups)


def answered(
    tables: IntegerTables, rejection: Rejection | None, bits: NDArray[np.bool_], codes: NDArray[np.uint16]
) -> Answers:
    """Return the classes (n,) that integers give rows of kept switches (n, s) and codes (n, j); K: refused."""
    scores = integer_scores(tables, bits, codes)
    found: Answers = scores.argmax(axis=1)
    if rejection is not None:
        found[refused(rejection, scores, bits, codes)] = tables.n_classes
    return found


def cross_validated(
    samples: Samples, cuts: Sequence[Cut], options: Options, test: Test, jobs: int, report: Report
) -> Tested | None:
    """Return what comes of the folds, None if there are none; `test` returns the scores of a fold's test rows.

    jobs  worker processes that call `test`; report: called with (done, all) after each fold
    """
    if not cuts:
        return None
    folds = [(place, fold) for place, cut in enumerate(cuts) for fold in cut.folds]
    answers = np.empty((len(cuts), len(samples.labels)), np.intp)
    scores = np.empty((len(samples.labels), samples.n_classes))
    knows = [learns_none(samples, cut) for cut in cuts]
    # Those that segments are learnt from know what nothing held is like, if any do.
    scored = next((place for place, rows in enumerate(knows) if rows.all()), 0)
    tasks = ((place, fold, test) for place, fold in folds)
    for done, (place, fold, found) in enumerate(
        in_workers(_done, tasks, little(len(folds) * len(samples.labels) * (options.rounds or USUAL_ROUNDS), jobs)), 1
    ):
        answers[place, fold.test] = found.argmax(axis=1)
        if place == scored:
            scores[fold.test] = found[:, : samples.n_classes]
        report(done, len(folds))
    refuses = not samples.has_none and bool((answers == samples.n_classes).any())
    confusion = np.zeros((samples.n_classes + refuses,) * 2, dtype=np.intp)
    np.add.at(confusion, (samples.labels[knows[0]], answers[0, knows[0]]), 1)
    measured, seed = list(zip(cuts, answers, strict=True)), options.seed
    rates = [rate for cut, own in measured for rate in rates_of("nested", samples, own, seed, cut)]
    detection = [each for cut, own in measured for each in detection_of("nested", samples, own, seed, cut)]
    return Tested(tuple(rates), tuple(detection), confusion, scores)


def learns_none(samples: Samples, cut: "Cut") -> NDArray[np.bool_]:
    """Return (n,) which rows are tested by a fold whose training rows hold some of nothing held; all, where none do.

    A subject may be the only one whose whole movements were recorded: who is tested on it has not learnt what is not.
    """
    found = np.ones(len(samples.labels), bool)
    for fold in cut.folds if samples.has_none else ():
        found[fold.test] = samples.is_none[fold.train].any()
    return found


def _done(task: tuple[int, Fold, Test]) -> tuple[int, Fold, Scores]:
    place, fold, test = task
    return place, fold, test(fold)


def segments_for(grasp_set: GraspSet, samples: Samples, scores: Scores | None, scale: float) -> SegmentModel | None:
    """Return the costs of segments for tables of `scale` steps per unit, learnt from whole movements and from the
    scores (n, K) of folds; None without movements.
    """
    if not samples.is_none.any():
        return None
    try:
        streams = streams_of(grasp_set)
    except SegmentingError:
        return None
    return learnt(streams, samples.labels, scores, samples.n_types, scale, TICK_US)


def rates_of(
    protocol: Protocol, samples: Samples, answers: Answers, seed: int, cut: Cut | None = None
) -> tuple[Recognised, ...]:
    """Return the rate of trials of grasps, and that of their frames where trials have several."""
    return _rates(protocol, samples, answers, samples.labels, ~samples.is_none, seed, cut)


def detection_of(
    protocol: Protocol, samples: Samples, answers: Answers, seed: int, cut: Cut | None = None
) -> tuple[Detected, ...]:
    """Return the share of trials of grasps in which something is said to be held, and of those of nothing held in which
    nothing is; and those of their frames where trials have several. There are none where no row is said to show that.
    """
    none = samples.is_none
    if not (none.any() or (answers == samples.n_types).any()):
        return ()
    said = (answers == samples.n_types).astype(np.intp)
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
    answers: Answers,
    truth: Answers,
    rows: NDArray[np.bool_],
    seed: int,
    cut: Cut | None,
) -> tuple[Recognised, ...]:
    """Return what `rated` does of these rows (n,)."""
    cut = cut or Cut("pooled", ())
    if not rows.any():
        return ()
    groups = None if cut.groups is None else cut.groups[rows]
    found = rated(answers[rows], truth[rows], samples.trials[rows], of=cut.of, groups=groups)
    return tuple(
        Recognised(
            protocol=protocol,
            folds=len(cut.folds),
            seed=seed,
            correct=rate.correct[0],
            total=rate.total,
            of=cut.of,
            unit=rate.unit,
            # The last digits of a quantile may differ between machines.
            low=round(rate.low, 6),
            high=round(rate.high, 6),
        )
        for rate in found
        if rate is not None
    )
