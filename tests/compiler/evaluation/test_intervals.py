"""Whether intervals cover the truth: by the benchmark's simulation, and on simulated frames of which folds are cut."""

import runpy
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from thenar.compiler.evaluation.folds import trial_folds, weka_folds
from thenar.compiler.evaluation.rates import Rate, rated

SIMULATED = runpy.run_path(str(Path(__file__).resolve().parents[3] / "benchmarks" / "intervals.py"))
coverage, of_frames, of_subjects, ACCURACIES = (
    SIMULATED[name] for name in ("coverage", "of_frames", "of_subjects", "ACCURACIES")
)


@pytest.mark.parametrize(
    ("unit", "clusters", "size", "alike"),
    [
        ("trials", 60, 1, 0.0),
        ("frames", 60, 8, 4 / 7),
        ("frames", 200, 15, 4 / 14),
        ("trials", 12, 100, 0.1),
        ("trials", 20, 100, 0.05),
    ],
)
def test_intervals_cover_the_truth_in_93_to_97_of_100_cases(unit: str, clusters: int, size: int, alike: float) -> None:
    covered = np.mean([coverage(unit, clusters, size, alike, each, 500) for each in ACCURACIES])
    assert 0.93 <= covered <= 0.97


@pytest.mark.slow
def test_intervals_cover_the_truth_for_any_frames_and_trials() -> None:
    for frames, effect, trials, covered in of_frames(200):
        # Of frames as different as trials, which real ones are not, the interval may be a little wide.
        most = 0.97 if effect > 1.5 or frames == 1 else 0.985
        assert 0.93 <= np.mean(covered) <= most, (frames, effect, trials)
        assert min(covered) >= 0.885, (frames, effect, trials)


@pytest.mark.slow
def test_so_they_do_for_5_to_30_subjects_left_out() -> None:
    for subjects, alike, covered in of_subjects(300):
        # Of few people, or where they hardly differ, the interval may be a little wide.
        most = 0.97 if subjects > 12 and alike > 0.02 else 0.985
        assert 0.93 <= np.mean(covered) <= most, (subjects, alike)
        assert min(covered) >= 0.90, (subjects, alike)


TYPES, TRIALS, FRAMES = 4, 15, 8
NOISE = 0.55  # of frames, where trials differ by 1: a design effect of about 4


def recorded(random: np.random.Generator) -> tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.intp]]:
    """Return joints (n, 4), labels (n,) and trials (n,) of 15 trials a type, of 8 frames each."""
    labels = np.repeat(np.arange(TYPES), TRIALS)
    means = 1.3 * np.eye(TYPES)[labels] + random.normal(0, 1, (len(labels), TYPES))
    frames = np.repeat(means, FRAMES, axis=0) + random.normal(0, NOISE, (len(labels) * FRAMES, TYPES))
    return frames, np.repeat(labels, FRAMES), np.repeat(np.arange(len(labels)), FRAMES)


def nearest(train: NDArray[np.float64], labels: NDArray[np.intp], test: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the label of the nearest row."""
    squares = (train**2).sum(axis=1) - 2 * test @ train.T
    found: NDArray[np.intp] = labels[squares.argmin(axis=1)]
    return found


@pytest.fixture(scope="module")
def simulations() -> list[tuple[float, Rate, Rate, Rate]]:
    """Of each set: the accuracy on fresh trials; the rate of random rows; of whole trials, by trials and by frames."""
    found = []
    for seed in range(100):
        random = np.random.default_rng(seed)
        X, labels, trials = recorded(random)
        fresh, true, _ = recorded(random)
        predicted = {}
        for name, folds in (
            ("rows", weka_folds(labels, 4, 1)),
            ("trials", trial_folds(labels, trials, 4, 1)),
        ):
            predicted[name] = np.zeros_like(labels)
            for fold in folds:
                predicted[name][fold.test] = nearest(X[fold.train], labels[fold.train], X[fold.test])
        truth = float(np.mean(nearest(X, labels, fresh) == true))
        leaked = Rate.counted((int((predicted["rows"] == labels).sum()),), len(labels), of="pooled")
        by_trial, by_frame = rated(predicted["trials"], labels, trials, of="pooled")
        assert by_frame is not None
        found.append((truth, leaked, by_trial, by_frame))
    return found


def test_random_folds_of_frames_are_too_high_and_cover_nothing(
    simulations: list[tuple[float, Rate, Rate, Rate]],
) -> None:
    truth = np.mean([each[0] for each in simulations])
    leaked = np.mean([each[1].mean for each in simulations])
    assert leaked - truth > 0.08
    assert np.mean([rate.low <= truth <= rate.high for _, rate, _, _ in simulations]) < 0.01


def test_whole_trials_counted_in_frames_cover_half_and_over_trials_nearly_always(
    simulations: list[tuple[float, Rate, Rate, Rate]],
) -> None:
    truth = np.mean([each[0] for each in simulations])
    frames = [each[3] for each in simulations]
    assert np.mean([rate.mean for rate in frames]) == pytest.approx(truth, abs=0.02)
    naive = [Rate.counted(rate.correct, rate.total, of="pooled") for rate in frames]
    assert 0.3 < np.mean([rate.low <= truth <= rate.high for rate in naive]) < 0.75
    # Less than 95 %: that a nearest neighbour's training set is a sample as well, no interval of its rate can know.
    assert np.mean([rate.low <= truth <= rate.high for rate in frames]) > 0.84
    widths = [(rate.high - rate.low) / (one.high - one.low) for rate, one in zip(frames, naive, strict=True)]
    assert 1.7 < np.mean(widths) < 2.8
