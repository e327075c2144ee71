"""The recognition rate to expect of a build: its own recipe, placement included, cross-validated."""

import numpy as np

from ...runtime.manifest import Options, Recognised
from ..boosting.stumps import winners
from ..evaluation.folds import weka_folds
from .errors import CompileError
from .training import Material, Report, Trained, train


def cross_validated(material: Material, options: Options, report: Report) -> Recognised:
    """Return the rate over stratified folds, each trained anew and without a look at its test rows."""
    correct = 0
    for number, fold in enumerate(weka_folds(material.labels, options.folds, options.seed)):
        trained = _train(material.rows(fold.train), options, number)
        test = material.rows(fold.test)
        scores = trained.stumps.scores(np.hstack([trained.kept(test), test.codes]))
        correct += int(np.count_nonzero(winners(scores) == test.labels))
        report(number + 1, options.folds)
    return Recognised("honest", options.folds, options.seed, correct, len(material.labels))


def _train(material: Material, options: Options, fold: int) -> Trained:
    try:
        return train(material, options)
    except CompileError as wrong:
        raise CompileError(f"in fold {fold + 1}: {wrong}, or do without folds (0)") from None
