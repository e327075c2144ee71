import numpy as np
from sklearn.linear_model import LogisticRegression
from sklearn.neighbors import KNeighborsClassifier

from thenar.compiler.evaluation.folds import Fold
from thenar.compiler.evaluation.plan import CLASSIFIERS, FoldFit, predictions
from thenar.compiler.placement.elements import Element
from thenar.compiler.samples import Samples

from .conftest import make_grasps


def test_baselines_answer_as_scikit_learns_on_the_same_standardised_columns() -> None:
    grasps = make_grasps(noise=0.3, per_type=10)
    samples, rows = Samples.of(grasps), np.arange(len(grasps))
    fold, columns = Fold(rows[::2], rows[1::2], "1"), (1, 3, 4, 12, 13)
    X = samples.inputs
    learnt = X[fold.train][:, columns].astype(float)
    mean, spread = learnt.mean(axis=0), learnt.std(axis=0)
    oracles = {
        "logistic-regression": LogisticRegression(max_iter=10_000),
        "5-nearest-neighbours": KNeighborsClassifier(5, weights="distance"),
    }
    assert oracles.keys() == {*CLASSIFIERS}
    for name, oracle in oracles.items():
        oracle.fit((learnt - mean) / spread, grasps.labels[fold.train])
        expected = oracle.predict((X[fold.test][:, columns] - mean) / spread)
        fit = FoldFit(fold, tuple(map(Element, columns[:3])), (0, 1), (0, 1, 2, 3), learner=name)
        assert np.array_equal(predictions(samples, fit, {}), expected)


def test_of_a_single_grasp_type_nothing_else_is_answered() -> None:
    grasps = make_grasps(noise=0.3)
    rows = np.flatnonzero(grasps.labels == 2)
    for name in CLASSIFIERS:
        fit = FoldFit(Fold(rows, np.arange(5), "1"), (Element(0), Element(1)), (0,), (0, 1, 2, 3), learner=name)
        assert predictions(Samples.of(grasps), fit, {}).tolist() == [2] * 5
