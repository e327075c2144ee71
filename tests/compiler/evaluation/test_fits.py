from dataclasses import replace

import numpy as np
import pytest

from thenar.compiler import LogitBoostClassifier
from thenar.compiler.evaluation.folds import Fold, weka_folds
from thenar.compiler.evaluation.plan import FoldFit, predictions
from thenar.compiler.placement.elements import Element
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.samples import Samples
from thenar.compiler.trainers.base import Training

from .conftest import make_grasps

QUICK = {"": (Training("logitboost", {"rounds": 5}),)}


@pytest.fixture
def fits() -> tuple[GraspSet, list[FoldFit]]:
    grasps = make_grasps(noise=0.3)
    folds = weka_folds(grasps.labels, 4, 1)
    inputs = [(tuple(map(Element, columns)), joints) for columns, joints in [((0, 1, 2), ()), ((3, 4), (0,))]]
    return grasps, [FoldFit(fold, *each, (0, 1, 2, 3)) for fold in folds for each in inputs]


def test_a_fit_answers_as_the_classifier_does(fits: tuple[GraspSet, list[FoldFit]]) -> None:
    grasps, todo = fits
    samples = Samples.of(grasps)
    training = Training("logitboost", {"rounds": 5, "shrinkage": 0.5})
    for fit in todo:
        columns = [*(element.column for element in fit.elements), *(12 + joint for joint in fit.joints)]
        part = samples.inputs[:, columns]
        classifier = LogitBoostClassifier(rounds=5, shrinkage=0.5)
        classifier.fit(part[fit.fold.train], grasps.labels[fit.fold.train])
        found = predictions(samples, fit, {"": (training,)})
        assert np.array_equal(found, classifier.predict(part[fit.fold.test]))


def test_labels_keep_their_numbers_where_some_do_not_occur() -> None:
    grasps = make_grasps(noise=0.0)
    rows = np.flatnonzero(np.isin(grasps.labels, (1, 3)))
    fold = Fold(rows[::2], rows[1::2], "1")
    found = predictions(Samples.of(grasps), FoldFit(fold, tuple(map(Element, range(12))), (), (1, 3)), QUICK)
    assert np.array_equal(found, grasps.labels[fold.test])


def test_without_inputs_the_most_frequent_training_label_is_answered() -> None:
    grasps = make_grasps()
    rows = np.concatenate([np.flatnonzero(grasps.labels == 2)[:5], np.flatnonzero(grasps.labels == 1)[:4]])
    fold = Fold(rows, np.arange(6), "1")
    found = predictions(Samples.of(grasps), FoldFit(fold, (), (), (0, 1, 2, 3)), QUICK)
    assert found.tolist() == [2] * 6


def test_where_no_input_varies_the_most_frequent_training_label_is_answered() -> None:
    grasps = make_grasps()
    rows = np.concatenate([np.flatnonzero(grasps.labels == 2)[:5], np.flatnonzero(grasps.labels == 1)[:4]])
    codes = grasps.codes.copy()
    codes[rows, :2] = 7, 65535
    samples = Samples.of(replace(grasps, codes=codes))
    fit = FoldFit(Fold(rows, np.arange(6), "1"), (), (0, 1), (0, 1, 2, 3))
    assert fit.is_blind(samples)
    assert predictions(samples, fit, QUICK).tolist() == [2] * 6
    codes[rows[-1], 1] = 0
    assert not fit.is_blind(Samples.of(replace(grasps, codes=codes)))
