"""The recognition rate to expect of a build: its own recipe, placement included, cross-validated."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.manifest import Options, Recognised

from ..boosting.stumps import winners
from ..evaluation.folds import weka_folds
from ..placement.ports import PortCosts
from ..samples import Samples
from .errors import CompileError
from .training import Report, Trained, train


@dataclass(frozen=True, slots=True, eq=False)
class Tested:
    """What came of the folds: the rate, and how often each grasp type (rows) was answered by each (columns), (K, K)."""

    rate: Recognised
    confusion: NDArray[np.intp]


def cross_validated(samples: Samples, options: Options, report: Report, ports: PortCosts | None = None) -> Tested:
    """Return what comes of stratified folds, each trained anew and without a look at its test rows."""
    confusion = np.zeros((len(samples.grasps),) * 2, dtype=np.intp)
    for number, fold in enumerate(weka_folds(samples.labels, options.folds, options.seed)):
        trained = _train(samples.rows(fold.train), options, number, ports)
        test = samples.rows(fold.test)
        scores = trained.stumps.scores(np.hstack([trained.kept(test), test.codes]))
        np.add.at(confusion, (test.labels, winners(scores)), 1)
        report(number + 1, options.folds)
    correct = int(np.trace(confusion))
    return Tested(Recognised("honest", options.folds, options.seed, correct, len(samples.labels)), confusion)


def _train(samples: Samples, options: Options, fold: int, ports: PortCosts | None) -> Trained:
    try:
        return train(samples, options, ports=ports)
    except CompileError as wrong:
        raise CompileError(f"in fold {fold + 1}: {wrong}, or do without folds (0)") from None
