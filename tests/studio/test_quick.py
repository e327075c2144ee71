"""The quick accuracy of sensors, compared with discriminants by scipy, row by row."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from thenar.compiler.artifact.training import cuts_of, samples_of
from thenar.compiler.evaluation.folds import EvaluationError
from thenar.compiler.placement.logistic import lines
from thenar.compiler.recordings.graspset import GraspSet
from thenar.runtime.recipe import Recipe
from thenar.studio.quick import SHRINKAGE, Quick, QuickAccuracy


@pytest.fixture(scope="module")
def quick(people: GraspSet) -> QuickAccuracy:
    return QuickAccuracy(people)


def discriminant(X: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the means of the types, and the shrunk scatter of rows around them."""
    means = np.array([X[y == one].mean(axis=0) for one in range(3)])
    inside = X - means[y]
    scatter = inside.T @ inside / len(y)
    return means, scatter + np.eye(X.shape[1]) * SHRINKAGE * np.trace(scatter) / X.shape[1]


def by_density(people: GraspSet, sensors: list[int]) -> np.ndarray:
    """Return the type of the largest density of each row, by the rows of other people."""
    samples = samples_of(people, Recipe())
    X = np.concatenate([samples.switches.T, lines(samples.codes)]).T[:, sensors]
    found = np.empty(len(X), np.intp)
    for fold in cuts_of(people, Recipe())[0].folds:
        y, learnt = samples.labels[fold.train], X[fold.train]
        means, scatter = discriminant(learnt, y)
        densities = [
            multivariate_normal(mean, scatter).logpdf(X[fold.test]) + np.log((y == one).mean())
            for one, mean in enumerate(means)
        ]
        found[fold.test] = np.argmax(np.atleast_2d(densities), axis=0)
    return found


@settings(max_examples=25)
@given(sensors=st.lists(st.integers(0, 9), min_size=1, max_size=6, unique=True))
def test_a_row_is_read_as_the_type_of_the_largest_density(
    people: GraspSet, quick: QuickAccuracy, sensors: list[int]
) -> None:
    """Each row is a trial."""
    expected = by_density(people, sorted(sensors))
    confusion = np.zeros((3, 3), int)
    np.add.at(confusion, (samples_of(people, Recipe()).labels, expected), 1)
    found = quick.of(sensors)
    counts = np.zeros((3, 3), int)
    np.add.at(counts, (quick.truth, np.array(found.read)), 1)
    assert counts.tolist() == confusion.tolist()
    assert found.mean == np.trace(confusion) / 72
    assert found.low <= found.mean <= found.high
    assert len(misread(quick, found)) == 72 - np.trace(confusion)
    assert quick.of(sensors[::-1]) == found


def misread(quick: QuickAccuracy, found: Quick) -> list[int]:
    """Return the numbers of trials that are recognised as another type."""
    return [int(trial) for trial in np.flatnonzero(np.array(found.read) != quick.truth)]


def test_the_truth_of_trials_is_their_type(people: GraspSet, quick: QuickAccuracy) -> None:
    assert [quick.grasps[truth] for truth in quick.truth] == people.grasps.tolist()
    assert misread(quick, quick.of([0, 1]))


def test_on_the_map_types_are_as_far_apart_as_scikit_learn_finds_them(people: GraspSet, quick: QuickAccuracy) -> None:
    """The same axes but for their signs, if nothing is shrunk: switches alone, of which none is constant."""
    from sklearn.discriminant_analysis import LinearDiscriminantAnalysis

    sensors = [0, 1, 2, 8, 9]
    samples = samples_of(people, Recipe())
    X = np.concatenate([samples.switches.T, lines(samples.codes)]).T[:, sensors]
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("thenar.studio.quick.SHRINKAGE", 0.0)
        found = quick.places(sensors)
    # Equal shares, so the mean of the types' means is that of all rows.
    expected = LinearDiscriminantAnalysis(solver="svd").fit(X, samples.labels).transform(X)
    for axis in range(2):
        assert abs(np.corrcoef(found[:, axis], expected[:, axis])[0, 1]) > 0.999
    assert quick.truth.tolist() == samples.labels.tolist()


def test_no_sensor_reads_the_most_frequent_type(quick: QuickAccuracy) -> None:
    assert quick.of([]).mean == pytest.approx(1 / 3)


def test_a_trial_shows_its_switches_and_joints_and_what_decided(people: GraspSet, quick: QuickAccuracy) -> None:
    sensors = [0, 1, 8]
    found = quick.of(sensors)
    trial = misread(quick, found)[0]
    truth, read = int(quick.truth[trial]), found.read[trial]
    seen = quick.seen(trial)
    assert seen[:8].tolist() == people.switches[trial].astype(float).tolist()
    low, high = people.codes.min(axis=0), people.codes.max(axis=0)
    assert seen[8:] == pytest.approx((people.codes[trial] - low) / (high - low), abs=5e-3)
    for kind in (truth, read):
        shares = people.switches[people.grasps == quick.grasps[kind]].mean(axis=0)
        assert quick.typical[kind][:8] == pytest.approx(shares, abs=1e-3)
    # By the inverse of the scatter, the share of each sensor in the difference of both types' scores.
    samples = samples_of(people, Recipe())
    X = np.concatenate([samples.switches.T, lines(samples.codes)]).T[:, sensors]
    others = samples.subjects != samples.subjects[trial]
    means, scatter = discriminant(X[others], samples.labels[others])
    between = means[read] - means[truth]
    shares = np.linalg.inv(scatter) @ between * (X[trial] - (means[read] + means[truth]) / 2)
    assert quick.decisive(trial, sensors) == [sensors[place] for place in np.argsort(-shares) if shares[place] > 0]
    right = int(np.flatnonzero(np.array(found.read) == quick.truth)[0])
    assert quick.decisive(right, sensors) == []


@pytest.mark.parametrize("sensors", [[10], [-1], [0, 99]])
def test_a_sensor_that_does_not_exist_is_refused(quick: QuickAccuracy, sensors: list[int]) -> None:
    with pytest.raises(EvaluationError, match="there are 10 sensors"):
        quick.of(sensors)
    with pytest.raises(EvaluationError, match="there are 72 trials"):
        quick.decisive(72, [])
    with pytest.raises(EvaluationError, match="there are 72 trials"):
        quick.seen(-1)
