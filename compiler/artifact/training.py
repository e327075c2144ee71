"""What `compile` trains: a placement, then a model on the kept switches and the joints; and both once more in folds."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.manifest import Options, Recognised

from ..boosting.stumps import Stumps, winners
from ..evaluation.folds import weka_folds
from ..limits import check_inputs, check_memory, check_types
from ..placement.methods.base import METHODS, PAPERS
from ..placement.placement import choose
from ..placement.ports import PortCosts
from ..placement.tree import Tree
from ..recordings.graspset import GraspSet
from ..samples import Columns, Samples
from ..tables.collapse import Model, model_scores
from ..trainers.base import Report, Training
from . import CompileError
from .ensemble import MAX_STUMPS, model_fault


@dataclass(frozen=True, slots=True, eq=False)
class Trained:
    """The kept switches in the order in which they were chosen, and what each brought (bits): to the tree of ID3, which
    is None where another method chose, and alone otherwise; and the model.
    """

    columns: Columns
    gains: tuple[float, ...]
    tree: Tree | None
    model: Model

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
    for kind, names in (("switches", grasp_set.switch_names), ("joints", grasp_set.joint_names)):
        if wanted == kind and not names:
            raise CompileError(f"the recordings have no {kind}: choose other inputs than {kind!r}")
    if (found := len(np.unique(grasp_set.labels))) < 2:
        raise CompileError(f"the recordings hold {found} grasp type(s): there is nothing to tell apart")
    samples = Samples.of(grasp_set, wanted)
    check_types(found, CompileError)
    check_inputs(found, min(options.keep or 0, samples.n_switches), samples.codes.shape[1], CompileError)
    check_memory(len(samples.codes), found, CompileError)
    if options.rounds * found > MAX_STUMPS:
        raise CompileError(
            f"{options.rounds} rounds of {found} grasp types are {options.rounds * found} stumps, a build has at most "
            f"{MAX_STUMPS}: boost for fewer rounds"
        )
    return samples


def train(samples: Samples, options: Options, report: Report | None = None, ports: PortCosts | None = None) -> Trained:
    """Choose the switches and train on them and the joints. Raises CompileError if no input tells grasps apart.

    ports  what reading switches costs, for methods that ask
    """
    # Without switches the tree is a leaf.
    method = options.placement if samples.n_switches else PAPERS
    parameter = options.keep or 0 if METHODS.named(method).by_number else options.prune
    chosen = choose(samples, method, float(parameter), ports)
    columns = chosen.columns
    if not columns and not samples.codes.shape[1]:
        raise CompileError("no switch is worth keeping: lower --prune, or record switches that differ between grasps")
    check_inputs(len(samples.grasps), len(columns), samples.codes.shape[1], CompileError)
    kept = samples.keeping(columns)
    inputs = kept.inputs
    if not (inputs != inputs[0]).any():
        raise CompileError("no input differs between rows: there is nothing to tell grasp types apart by")
    model = Training.of(options).train(kept, report)
    if fault := model_fault(model, kept.n_switches, kept.codes.shape[1], kept.n_classes):
        raise CompileError(f"trainer {options.trainer!r} made a model that {fault}: it is at fault")
    return Trained(columns, chosen.gains, chosen.tree, model)


@dataclass(frozen=True, slots=True, eq=False)
class Tested:
    """What came of the folds: the rate, and how often each grasp type (rows) was answered by each (columns), (K, K)."""

    rate: Recognised
    confusion: NDArray[np.intp]


def cross_validated(samples: Samples, options: Options, report: Report, ports: PortCosts | None = None) -> Tested:
    """Return what comes of stratified folds, each trained anew and without a look at its test rows."""
    confusion = np.zeros((len(samples.grasps),) * 2, dtype=np.intp)
    for number, fold in enumerate(weka_folds(samples.labels, options.folds, options.seed), 1):
        try:
            trained = train(samples.rows(fold.train), options, ports=ports)
        except CompileError as wrong:
            raise CompileError(f"in fold {number}: {wrong}, or do without folds (0)") from None
        test = samples.rows(fold.test).keeping(trained.columns)
        np.add.at(confusion, (test.labels, winners(model_scores(trained.model, test.switches, test.codes))), 1)
        report(number, options.folds)
    correct = int(np.trace(confusion))
    return Tested(Recognised("honest", options.folds, options.seed, correct, len(samples.labels)), confusion)
